"""Every weather parameter of CARLA changes a picture, and as it should."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, build_mesh, merge_meshes
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.film import CLEAR_NOON_EXPOSURE, Film
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.quality import Quality
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.state import Weather
from ray_scenes import frame_of, turned_box

pytestmark = pytest.mark.xdist_group("kernels")

_NOON = Weather(
    cloudiness=5.0, sun_azimuth_angle=150.0, sun_altitude_angle=45.0, wind_intensity=10.0
)
_CAMERA = Camera(96, 72, 80.0, (-8.0, 0.0, 2.0), (-8.0, 0.0, 0.0), 0)


def block(low, high, material, tag, object_id=0):
    low, high = np.array(low), np.array(high)
    unit = turned_box((1.0, 1.0, 1.0))
    corners = (unit.vertices + 0.5) * (high - low) + low
    return build_mesh(corners, unit.triangles, material, tag, object_id=object_id)


SCENE = frame_of(
    merge_meshes(
        [
            block((-60, -60, -1), (400, 60, 0), Material.ASPHALT, CityObjectLabel.ROADS),
            block((12, 2, 0), (14, 9, 8), Material.BRICK, CityObjectLabel.BUILDINGS, 1),
            block((12, -9, 0), (14, -3, 6), Material.FOLIAGE, CityObjectLabel.VEGETATION, 2),
            block((150, -9, 0), (155, 9, 30), Material.PLASTER, CityObjectLabel.BUILDINGS, 3),
        ]
    )
)


@lru_cache
def maker(quality=Quality.LOW):
    """One for all tests: the noise of its clouds takes longer than a picture."""
    return PictureMaker(RayCaster(1), quality)


def picture(weather, *, time_s=1.0, camera=_CAMERA, quality=Quality.LOW):
    view = View(lambda: SCENE, RayCaster(1), maker(quality), weather, time_s)
    return view.colours(camera, Film()).astype(int)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("cloudiness", 80.0),
        ("precipitation", 60.0),
        ("precipitation_deposits", 60.0),
        ("wind_intensity", 90.0),
        ("sun_azimuth_angle", 60.0),
        ("sun_altitude_angle", 15.0),
        ("fog_density", 40.0),
        ("wetness", 80.0),
        ("scattering_intensity", 5.0),
        ("mie_scattering_scale", 0.3),
        ("rayleigh_scattering_scale", 0.1),
        ("dust_storm", 60.0),
    ],
)
def test_each_parameter_changes_the_picture(name, value):
    changed = np.abs(picture(replace(_NOON, **{name: value})) - picture(_NOON))
    assert (changed.max(axis=2) >= 3).mean() > 0.02


@pytest.mark.parametrize(("name", "value"), [("fog_distance", 100.0), ("fog_falloff", 3.0)])
def test_parameters_of_fog_change_a_foggy_picture(name, value):
    foggy = replace(_NOON, fog_density=60.0)
    changed = np.abs(picture(replace(foggy, **{name: value})) - picture(foggy))
    assert (changed.max(axis=2) >= 3).mean() > 0.1


def test_fog_that_thins_with_height_leaves_the_tops_of_towers():
    def contrast(falloff):
        codes = picture(replace(_NOON, fog_density=50.0, fog_falloff=falloff))
        return np.abs(codes[20:26, 44:52].mean(axis=(0, 1)) - codes[2:6, 44:52].mean(axis=(0, 1)))

    assert contrast(3.0).max() > contrast(0.0).max() + 5


def test_puddles_mirror_what_stands_behind_them():
    down = Camera(96, 72, 80.0, (-8.0, 0.0, 2.0), (-25.0, 0.0, 0.0), 0)
    dry, wet = (
        picture(replace(_NOON, precipitation_deposits=share), camera=down) for share in (0.0, 100.0)
    )

    # Under the brick wall the road is redder than in the middle, but only where water stands.
    def redness(codes, columns):
        area = codes[16:30, columns]
        return area[..., 0].mean() - area[..., 2].mean()

    right, middle = slice(52, 76), slice(42, 50)
    assert abs(redness(dry, right) - redness(dry, middle)) < 4
    assert redness(wet, right) > redness(wet, middle) + 4


def test_rain_falls_and_its_streaks_move():
    heavy = replace(_NOON, precipitation=100.0)
    # Near enough that a streak is as wide as a pixel.
    near = replace(_CAMERA, fov_deg=20.0, rotation_deg=(5.0, 0.0, 0.0))
    now, later = (picture(heavy, time_s=time_s, camera=near) for time_s in (1.0, 1.05))
    assert (np.abs(now - later).max(axis=2) > 5).mean() > 0.01
    dry = picture(replace(_NOON, wind_intensity=0.0))
    assert np.array_equal(dry, picture(replace(_NOON, wind_intensity=0.0), time_s=1.05))


def test_a_streak_of_rain_is_the_way_of_a_sixtieth_of_a_second():
    """13 cm: of the nearest ones, at 2.5 m, at most 15 px here; two may meet in one column."""
    rain = replace(_NOON, precipitation=60.0, wind_intensity=0.0)
    wall = frame_of(block((30, -20, 0), (31, 20, 20), Material.TAR, CityObjectLabel.WALLS))
    level = Camera(96, 72, 20.0, (0.0, 0.0, 6.0), (0.0, 0.0, 0.0), 0)
    codes = View(lambda: wall, RayCaster(1), maker(), rain, 1.0).colours(level, Film()).sum(axis=2)
    streaks = codes.astype(int) - np.median(codes, axis=1, keepdims=True) > 15
    edges = np.diff(np.pad(streaks, ((1, 1), (0, 0))).astype(int).T, axis=1)
    lengths = np.argwhere(edges == -1)[:, 1] - np.argwhere(edges == 1)[:, 1]
    assert 10 <= lengths.max() <= 30
    assert 0.02 < streaks.mean() < 0.2


def test_black_paint_mirrors_a_low_sky_nearly_as_a_pane_does():
    """At a slant of five degrees clear coat throws back half of the light."""
    plates = frame_of(
        merge_meshes(
            [
                block((6, y, 0), (14, y + 3, 1.0), material, CityObjectLabel.CAR, k + 1)
                for k, (y, material) in enumerate(
                    ((-4, Material.PAINT_BLACK), (1, Material.GLASS_DARK))
                )
            ]
        )
    )
    flat = Camera(96, 72, 80.0, (-4.0, 0.0, 2.0), (-6.0, 0.0, 0.0), 0)
    view = View(lambda: plates, RayCaster(1), maker(), _NOON, 1.0)
    codes = view.colours(flat, Film()).astype(int)
    paint, pane, sky = codes[34, 37:42].mean(), codes[34, 56:61].mean(), codes[34, 5].mean()
    assert 0.95 * pane < paint < pane < 0.9 * sky


def test_epic_darkens_corners_and_mirrors_in_glass():
    low, epic = picture(_NOON), picture(_NOON, quality=Quality.EPIC)
    assert (low != epic).any(axis=2).mean() > 0.03
    darker = (low - epic).max(axis=2) > 2
    assert darker.mean() > 0.01


def test_a_clear_noon_has_the_exposure_that_manual_ones_start_from():
    noon = Weather(
        cloudiness=5.0, wind_intensity=10.0, sun_azimuth_angle=-1.0, sun_altitude_angle=45.0,
        fog_density=2.0, fog_distance=0.75, fog_falloff=0.1,
    )  # fmt: skip
    light = maker().sky.lighting(noon, 0.0)
    assert float(light.exposure) == pytest.approx(CLEAR_NOON_EXPOSURE, rel=0.01)
    assert Film().exposed(light).exposure == light.exposure
    assert float(Film(manual=True).exposed(light).exposure) == pytest.approx(
        CLEAR_NOON_EXPOSURE, rel=1e-6
    )
    night = maker().sky.lighting(replace(noon, sun_altitude_angle=-90.0), 0.0)
    assert Film().exposed(night).exposure == night.exposure
    bound = Film(darkest_ev=12.0).exposed(night).exposure
    assert float(bound) == pytest.approx(CLEAR_NOON_EXPOSURE, rel=0.01)
