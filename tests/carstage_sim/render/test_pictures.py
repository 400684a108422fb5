"""Colour pictures: shadows, lamps, weather, edges, and the same bytes every time."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, build_mesh, merge_meshes
from carstage_sim.render.caster import RayCaster, picture_packets
from carstage_sim.render.film import Film
from carstage_sim.render.materials import APPEARANCES, linear_colour
from carstage_sim.render.picture import Picture, PictureMaker
from carstage_sim.render.scene import PAINTS, Placement
from carstage_sim.render.shading import mirrored_by_pane
from carstage_sim.sensors.view import Camera, pixel_rays
from carstage_sim.world.state import Weather
from ray_scenes import frame_of, turned_box

pytestmark = pytest.mark.xdist_group("kernels")

_NOON = Weather(sun_altitude_angle=60.0, sun_azimuth_angle=180.0, cloudiness=0.0)
_NIGHT = Weather(sun_altitude_angle=-40.0)


def plate(low, high, material, z=0.0):
    corners = np.array(
        [[low[0], low[1], z], [high[0], low[1], z], [high[0], high[1], z], [low[0], high[1], z]]
    )
    return build_mesh(corners, [[0, 1, 2], [0, 2, 3]], material, CityObjectLabel.ROADS)


GROUND = plate((-50, -50), (50, 50), Material.DEFAULT)
BOX = turned_box((2.0, 2.0, 2.0))


def paint(frame, weather=_NOON, location=(-8.0, 0.0, 3.0), rotation=(-18.0, 0.0, 0.0), threads=1):
    camera = Camera(64, 48, 80.0, location, rotation, 0)
    caster = RayCaster(threads)
    maker = PictureMaker(caster)
    hits = caster.cast(frame.scene, np.asarray(location), pixel_rays(camera), low=0.1, high=1000.0)
    picture = Picture(64, 48, 80.0, rotation_matrix(rotation), hits, -1, 0.1, 1000.0)
    codes = maker.paint(frame, picture, maker.sky.lighting(weather, 0.0))
    caster.close()
    return codes, hits


def with_box(material=None, light_state=0, **kwargs):
    mesh = BOX
    if material is not None:
        mesh = build_mesh(BOX.vertices, BOX.triangles, material, CityObjectLabel.TRAFFIC_LIGHT)
    place = Placement(
        1, "box", np.array([0.0, 0.0, 1.0]), np.eye(3), light_state=light_state, **kwargs
    )
    return frame_of(GROUND, [place], {"box": mesh})


def test_every_material_has_an_appearance():
    assert set(APPEARANCES) == set(Material)


def test_a_shadow_lies_away_from_the_sun():
    # The sun stands at azimuth 180 (-x), so the box's shadow falls towards +x.
    frame = with_box()
    codes, _ = paint(frame, location=(0.0, 0.0, 14.0), rotation=(-89.0, 0.0, 0.0))
    middle = codes[:, 32].astype(int).sum(axis=1)
    ahead, behind = middle[19:20], middle[28:30]
    assert ahead.max() < 0.6 * behind.min()


@pytest.mark.parametrize(
    ("material", "on", "off", "channel"),
    [
        (Material.LIGHT_RED, 0, 2, 0),
        (Material.LIGHT_GREEN, 2, 0, 1),
        (Material.TAIL_LAMP, 8, 0, 0),
        (Material.HEAD_LAMP, 2, 0, 1),
        (Material.BRAKE_LAMP, 8, 3, 0),
        (Material.BEACON_BLUE, 512, 3, 2),
        (Material.REVERSE_LAMP, 64, 0, 1),
    ],
)
def test_lamps_glow_in_their_state_only(material, on, off, channel):
    def brightness(state):
        codes, hits = paint(with_box(material, state))
        lens = (hits.row == 0).reshape(48, 64)
        return codes[lens][:, channel].astype(int).mean()

    assert brightness(on) > brightness(off) + 25


@pytest.mark.parametrize(
    "weather", [_NOON, Weather(sun_altitude_angle=-40.0)], ids=["day", "night"]
)
@pytest.mark.parametrize(
    ("material", "state", "hue_deg"),
    [
        (Material.LIGHT_RED, 0, (-6, 6)),
        (Material.LIGHT_YELLOW, 1, (26, 42)),
        (Material.LIGHT_GREEN, 2, (150, 175)),
        (Material.TAIL_LAMP, 1, (-6, 6)),
        (Material.BRAKE_LAMP, 8, (-6, 6)),
        (Material.BLINKER_LEFT, 32, (26, 42)),
        (Material.BEACON_BLUE, 512, (215, 245)),
    ],
)
def test_lit_lamps_have_the_colours_of_the_rules(material, state, hue_deg, weather):
    """Saturated red, amber, green and blue: none is pale, though the film saturates."""
    codes, hits = paint(with_box(material, state), weather)
    lens = (hits.row == 0).reshape(48, 64)
    colour = np.median(codes[lens][:, :3].astype(float), axis=0) / 255.0
    hue, saturation, value = colorsys.rgb_to_hsv(*colour)
    assert hue_deg[0] <= (hue * 360.0 + 90.0) % 360.0 - 90.0 <= hue_deg[1]
    assert saturation > 0.7
    assert value > 0.8


def test_the_ground_under_a_car_is_dark_where_no_sun_shines():
    """A gap of 0.25 m under 2 m of width lets about an eighth of the sky's light in."""
    store = frame_of(GROUND, [Placement(1, "box", np.array([0.0, 0.0, 1.25]), np.eye(3))],
                     {"box": BOX})  # fmt: skip
    eye, turned = (-3.5, 0.0, 0.5), (-5.0, 0.0, 0.0)
    codes, hits = paint(store, Weather(sun_altitude_angle=60.0, cloudiness=100.0), eye, turned)
    rays = pixel_rays(Camera(64, 48, 80.0, eye, turned, 0))
    places = np.asarray(eye) + rays * hits.t[:, None]
    ground = (hits.row == -1) & (np.abs(places[:, 2]) < 0.01)
    light = linear_colour(codes.reshape(-1, 3)[:, 0])
    under = ground & (np.abs(places[:, :2]) < 0.7).all(axis=1)
    beside = ground & (np.abs(places[:, 1]) > 1.5) & (np.abs(places[:, 0]) < 1.5)
    assert under.sum() > 10
    assert light[under].mean() < 0.35 * light[beside].mean()


def behind_glass(*behind, static=(), kind=Material.GLASS):
    """Mean colour of a pane that an actor carries, with things behind it."""
    pane = build_mesh(
        [[-3.0, -2.0, 0.0], [-3.0, 2.0, 0.0], [-3.0, 2.0, 3.0], [-3.0, -2.0, 3.0]],
        [[0, 1, 2], [0, 2, 3]], kind, CityObjectLabel.CAR,
    )  # fmt: skip
    ground = merge_meshes([GROUND, *static])
    mesh = merge_meshes([pane, *behind])
    frame = frame_of(ground, [Placement(1, "car", np.zeros(3), np.eye(3))], {"car": mesh})
    codes, hits = paint(frame)
    # The pane's two triangles come first.
    glass = ((hits.row == 0) & (hits.triangle < 2)).reshape(48, 64)
    assert glass.sum() > 200
    return codes[glass].astype(int).mean(axis=0)


def wall(material, tag=CityObjectLabel.CAR, x=-1.0):
    return build_mesh(
        [[x, -6.0, 0.0], [x, 6.0, 0.0], [x, 6.0, 6.0], [x, -6.0, 6.0]],
        [[0, 1, 2], [0, 2, 3]], material, tag,
    )  # fmt: skip


def test_glass_shows_what_is_behind_it_but_is_what_rays_meet():
    seat, red = behind_glass(wall(Material.SEAT)), behind_glass(wall(Material.SIGN_RED))
    assert red[0] - red[1] > seat[0] - seat[1] + 15
    beyond = behind_glass(static=[wall(Material.SIGN_RED, CityObjectLabel.WALLS)])
    assert beyond[0] - beyond[1] > seat[0] - seat[1] + 15


def test_sheet_metal_shows_its_lining_inside():
    lining, red = behind_glass(wall(Material.PAINT_RED)), behind_glass(wall(Material.SIGN_RED))
    assert lining[0] - lining[1] < (red[0] - red[1]) / 2


def test_a_second_pane_shows_the_street_beyond_darker():
    street = [wall(Material.SIGN_WHITE, CityObjectLabel.WALLS, x=1.0)]
    one = behind_glass(static=street)
    two = behind_glass(wall(Material.GLASS, x=-2.0), static=street)
    seat = behind_glass(wall(Material.SEAT, x=-2.0), static=street)
    assert seat.mean() + 5 < two.mean() < one.mean() - 5


def test_privacy_glass_shows_a_third_of_what_clear_glass_does():
    """It lets 22 % of the light through, clear glass 68 %."""
    red, dark = wall(Material.SIGN_RED), wall(Material.PAINT_BLACK)

    def shown(kind):
        lit, unlit = (
            linear_colour(behind_glass(one, kind=kind).astype(np.uint8)) for one in (red, dark)
        )
        return lit[0] - unlit[0]

    assert shown(Material.GLASS_TINTED) > 0.002
    assert shown(Material.GLASS_TINTED) == pytest.approx(0.32 * shown(Material.GLASS), rel=0.25)


def test_both_faces_of_a_pane_mirror():
    """Fresnel's equations for crown glass (n = 1.52): 8 % head on, 16 % at 60 degrees."""

    def share(grazing):
        return mirrored_by_pane.py_func(np.float32(0.08), np.float32(grazing))

    def fresnel(angle_rad):
        inside = np.arcsin(np.sin(angle_rad) / 1.52)
        across = np.sin(angle_rad - inside) / np.sin(angle_rad + inside)
        along = np.tan(angle_rad - inside) / np.tan(angle_rad + inside)
        return np.mean([2 * r / (1 + r) for r in (across**2, along**2)])

    for angle_deg in (20.0, 45.0, 60.0, 75.0):
        angle = np.radians(angle_deg)
        assert share((1.0 - np.cos(angle)) ** 5) == pytest.approx(fresnel(angle), abs=0.035)
    assert share(0.0) == pytest.approx(0.08, abs=1e-6)


def test_paint_takes_the_instances_colour():
    def colour(srgb):
        codes, hits = paint(with_box(colours=(srgb,) * PAINTS))
        return codes[(hits.row == 0).reshape(48, 64)].astype(int).mean(axis=0)

    red, blue = colour((200, 10, 10)), colour((10, 10, 200))
    assert red[0] > red[2] + 40
    assert blue[2] > blue[0] + 40


def test_night_is_darker_than_day_and_wet_ground_darker_than_dry():
    def ground(weather):
        codes, hits = paint(frame_of(GROUND), weather, rotation=(-60.0, 0.0, 0.0))
        return codes.reshape(-1, 3)[hits.row == -1].astype(int).mean()

    day = ground(_NOON)
    assert ground(Weather(sun_altitude_angle=-90.0)) < 0.7 * day
    wet = Weather(sun_altitude_angle=60.0, sun_azimuth_angle=180.0, wetness=80.0)
    assert ground(wet) < day


def test_fog_takes_contrast_from_far_things():
    def contrast(fog_density):
        weather = Weather(sun_altitude_angle=60.0, fog_density=fog_density)
        place = Placement(1, "box", np.array([40.0, 0.0, 1.0]), np.eye(3))
        codes, hits = paint(frame_of(GROUND, [place], {"box": BOX}), weather)
        box = codes.reshape(-1, 3)[hits.row == 0].astype(int).mean(axis=0)
        ground = codes.reshape(-1, 3)[hits.row == -1].astype(int).mean(axis=0)
        return np.abs(box - ground).max()

    assert contrast(90.0) < 0.6 * contrast(0.0)


def test_pixels_on_edges_are_mixed():
    frame = with_box()
    codes, hits = paint(frame)
    maker = PictureMaker(RayCaster(1))
    light = maker.sky.lighting(_NOON, 0.0)
    angle = 2.0 * np.tan(np.radians(40.0)) / 64
    packets = picture_packets(64, 48)
    shaded = np.empty((64 * 48, 3), np.float32)
    maker._shade(frame, hits, packets, -1, angle, light, shaded)
    plain = Film().encode(shaded).reshape(48, 64, 3)
    changed = (plain != codes).any(axis=2)
    assert 0.01 < changed.mean() < 0.5


def test_pictures_are_the_same_bytes_again_and_with_two_threads():
    frame = with_box()
    first, _ = paint(frame)
    again, _ = paint(frame)
    two, _ = paint(frame, threads=2)
    assert first.tobytes() == again.tobytes() == two.tobytes()
