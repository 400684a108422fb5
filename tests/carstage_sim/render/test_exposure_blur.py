"""What moves while the shutter is open is smeared over its way; what stands still is not."""

from __future__ import annotations

import math
from contextlib import closing

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.exposure_blur import blurred
from carstage_sim.render.film import Film, light_of_codes
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.sensors.motions import Seen, motions_between, motions_in, seen_actors
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

FILM = Film()
LIGHT = light_of_codes(FILM.gamma).astype(float)
HEIGHT, WIDTH = 96, 256
DARK, BRIGHT = 60, 180
NEAR_M, FAR_M = 10.0, 50.0


@pytest.fixture(scope="module")
def caster():
    with closing(RayCaster(2)) as made:
        yield made


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A dark picture, far away, that stands still: codes, depths, flow."""
    pixels = np.full((HEIGHT, WIDTH, 4), DARK, np.uint8)
    pixels[..., 3] = 255
    depth = np.full((HEIGHT, WIDTH), FAR_M, np.float32)
    return pixels, depth, np.zeros((HEIGHT, WIDTH, 2), np.float32)


def with_board(way_px: tuple[float, float], first: int = 100, last: int = 140):
    """The same with a bright board in front that moves by so many pixels, right and down."""
    pixels, depth, flow = scene()
    board = (slice(30, 70), slice(first, last))
    pixels[board][..., :3] = BRIGHT
    depth[board] = NEAR_M
    flow[board] = way_px[0] * 2.0 / WIDTH, -way_px[1] * 2.0 / HEIGHT
    return pixels, depth, flow


@pytest.mark.parametrize("way", [6.0, 16.0, -16.0])
def test_a_moving_edge_becomes_a_ramp_as_wide_as_its_way(caster, way):
    pixels, depth, flow = with_board((way, 0.0))
    shown = blurred(caster, FILM, pixels, depth.ravel(), flow)
    share = (LIGHT[shown[50, :, 0]] - LIGHT[DARK]) / (LIGHT[BRIGHT] - LIGHT[DARK])
    for edge, inwards in ((100, 1.0), (140, -1.0)):
        beyond = inwards * (np.arange(WIDTH) + 0.5 - edge)
        near = abs(beyond) < 20
        wanted = np.clip(beyond / abs(way) + 0.5, 0.0, 1.0)
        assert abs(share - wanted)[near].max() < 0.6 / abs(way)
    assert LIGHT[shown[..., 0]].sum() == pytest.approx(LIGHT[pixels[..., 0]].sum(), rel=2e-3)
    # Its upper and lower edges move along themselves.
    assert np.array_equal(shown[:30], pixels[:30])
    assert np.array_equal(shown[70:], pixels[70:])


def test_motion_downwards_smears_downwards(caster):
    pixels, depth, flow = with_board((0.0, 12.0))
    shown = blurred(caster, FILM, pixels, depth.ravel(), flow)
    changed = np.nonzero((shown != pixels).any(axis=(1, 2)))[0]
    assert (changed.min(), changed.max()) == (24, 75)
    assert np.array_equal(shown[:, :100], pixels[:, :100])


def test_what_stands_still_in_front_stays_sharp(caster):
    pixels, depth, flow = with_board((16.0, 0.0))
    post = (slice(0, HEIGHT), slice(118, 122))
    pixels[post][..., :3], depth[post], flow[post] = 120, 4.0, 0.0
    shown = blurred(caster, FILM, pixels, depth.ravel(), flow)
    assert np.array_equal(shown[post], pixels[post])


def test_a_panned_picture_is_the_mean_along_the_way(caster):
    pixels, depth, flow = scene()
    noise = np.random.default_rng(1).integers(20, 220, (HEIGHT, WIDTH), dtype=np.uint8)
    pixels[..., :3] = noise[..., None]
    flow[..., 0] = 9.0 * 2.0 / WIDTH
    shown = LIGHT[blurred(caster, FILM, pixels, depth.ravel(), flow)[..., 0]]
    wanted = np.apply_along_axis(np.convolve, 1, LIGHT[noise], np.ones(9) / 9.0, "same")
    inside = (slice(None), slice(10, -10))
    assert abs(shown - wanted)[inside].max() < 0.01


def test_light_is_averaged_not_codes(caster):
    pixels, depth, flow = scene()
    pixels[:, 128, :3] = 255
    flow[..., 0] = 9.0 * 2.0 / WIDTH
    shown = blurred(caster, FILM, pixels, depth.ravel(), flow)
    wanted = (LIGHT[255] + 8.0 * LIGHT[DARK]) / 9.0
    assert LIGHT[shown[50, 128, 0]] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (97, 33)])
def test_bytes_do_not_depend_on_threads(size):
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, 256, (*size, 4), dtype=np.uint8)
    depth = rng.uniform(1.0, 100.0, size).astype(np.float32)
    depth[0, 0] = np.inf
    flow = rng.uniform(-2.0, 2.0, (*size, 2)).astype(np.float32)
    made = []
    for threads in (1, 3):
        with closing(RayCaster(threads)) as caster:
            made.append(blurred(caster, FILM, pixels, depth.ravel(), flow))
    assert np.array_equal(*made)
    assert np.array_equal(made[0][..., 3], pixels[..., 3])


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    folder = tmp_path_factory.getbasetemp() / "trees"
    with WorldSensors(town(GROUND, WALL), threads=2, cache=folder) as built:
        yield built


def look(sensors, world, owner_id: int = 0, **attributes):
    """Colours and semantic tags."""
    size = {"image_size_x": 320, "image_size_y": 200, "fov": 90.0}
    rig = [
        request("camera.rgb", 100, owner_id=owner_id, **size, **attributes),
        request("camera.semantic_segmentation", 101, owner_id=owner_id, **size),
    ]
    sensors.reset()
    frames = dict(sensors.capture(world, rig))
    return frames[100].pixels.copy(), frames[101].pixels[..., 2]


BLUR = {"shutter_blur": "true", "shutter_speed": "20"}
CAR = (1, (8.0, 0.0, 0.0), 90.0)


def test_where_nothing_moves_the_bytes_stay(sensors):
    world = state(vehicles=[CAR])
    assert np.array_equal(look(sensors, world)[0], look(sensors, world, **BLUR)[0])


def test_a_car_is_smeared_over_its_way_and_its_surroundings_keep_their_bytes(sensors):
    world = state(vehicles=[CAR], velocity=(0.0, 10.0, 0.0))
    sharp, tags = look(sensors, world)
    shown, _ = look(sensors, world, **BLUR)
    car = tags == CityObjectLabel.CAR
    rows, columns = np.nonzero(car)
    changed = (shown != sharp).any(axis=-1)
    assert changed[car].mean() > 0.3
    # Half a metre of way at 7 to 9 m: 9 to 11 pixels, half of them to each side.
    ahead, behind = np.nonzero(changed.any(axis=0))[0][[-1, 0]]
    assert 3 <= ahead - columns.max() <= 7
    assert 3 <= columns.min() - behind <= 7
    assert not changed[: rows.min() - 1].any()
    assert not changed[rows.max() + 2 :].any()
    short, _ = look(sensors, world, shutter_blur="true", shutter_speed="2000")
    assert (short != sharp).any(axis=-1).sum() < 0.2 * changed.sum()


def test_a_camera_that_turns_with_its_carrier_smears_the_wall(sensors):
    world = state(vehicles=[(1, (-3.0, 0.0, 0.0), 0.0)], angular_velocity_deg=(0.0, 0.0, 40.0))
    sharp, _ = look(sensors, world, owner_id=1)
    shown, _ = look(sensors, world, owner_id=1, **BLUR)
    wall = (slice(20, 60), slice(60, 260))

    def roughness(pixels: np.ndarray, axis: int) -> float:
        return float(abs(np.diff(pixels[wall][..., 1].astype(float), axis=axis)).mean())

    assert roughness(shown, 1) < 0.5 * roughness(sharp, 1)
    standing, _ = look(sensors, world, owner_id=0, **BLUR)
    unmoved, _ = look(sensors, world, owner_id=0)
    assert np.array_equal(standing[wall], unmoved[wall])


def test_motions_by_velocities_are_those_between_the_two_poses(sensors):
    seconds, yaw_deg_s, velocity = 0.02, 30.0, np.array([3.0, -5.0, 0.5])
    now = state(
        vehicles=[(1, (8.0, 2.0, 0.0), 50.0), (2, (-3.0, 0.0, 0.0), 10.0)],
        velocity=tuple(velocity), angular_velocity_deg=(0.0, 0.0, yaw_deg_s),
    )  # fmt: skip
    turned = yaw_deg_s * seconds
    then = state(
        vehicles=[
            (1, tuple(np.array([8.0, 2.0, 0.0]) - velocity * seconds), 50.0 - turned),
            (2, tuple(np.array([-3.0, 0.0, 0.0]) - velocity * seconds), 10.0 - turned),
        ]
    )
    place = np.array([-2.0, 0.3, 1.5])
    camera = request("camera.rgb", location=tuple(place), rotation_deg=(2.0, 15.0, 0.0), owner_id=2)
    frame = sensors.frame_of(now)
    found = motions_in(seconds, now, camera, frame)
    angle = math.radians(turned)
    back = np.array(
        [[math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0],
         [0.0, 0.0, 1.0]]
    )  # fmt: skip
    carrier = np.array([-3.0, 0.0, 0.0])
    before = Seen(
        rotation_matrix((2.0, 15.0 - turned, 0.0)),
        back @ (place - carrier) + carrier - velocity * seconds,
        None,
    )
    here = Seen(rotation_matrix((2.0, 15.0, 0.0)), place, None)
    earlier = seen_actors(then, sensors.frame_of(then))
    wanted = motions_between(here, before, seen_actors(now, frame), earlier, frame)
    assert np.array_equal(found.part, wanted.part)
    np.testing.assert_allclose(found.turn, wanted.turn, atol=1e-12)
    np.testing.assert_allclose(found.shift, wanted.shift, atol=1e-12)


def test_a_value_that_is_neither_true_nor_false_is_refused(sensors):
    with pytest.raises(SensorAttributeError, match="shutter_blur"):
        look(sensors, state(), shutter_blur="often")
