"""Lenses scatter what outshines white: energy, shape, colour, and bytes where nothing does."""

from __future__ import annotations

import math
from contextlib import closing

import numpy as np
import pytest

from carstage_sim.maps import load_town
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.film import Film, light_of_codes
from carstage_sim.render.glare import BLOOM_SHARE, GHOST_SHARE, WHITE, scattered_light, with_glare
from carstage_sim.render.sky import SkyModel
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.world.state import Weather
from carstage_sim.world.world import World

pytestmark = pytest.mark.xdist_group("kernels")

FILM = Film()
HEIGHT, WIDTH = 256, 512


@pytest.fixture(scope="module")
def caster():
    with closing(RayCaster(2)) as made:
        yield made


def dark(*lamps: tuple[int, int, tuple[int, int, int]], level: int = 30) -> np.ndarray:
    """A dark picture with lamps of 4x4 pixels: row, column, BGR."""
    pixels = np.full((HEIGHT, WIDTH, 4), level, np.uint8)
    pixels[..., 3] = 255
    for y, x, colour in lamps:
        pixels[y : y + 4, x : x + 4, :3] = colour
    return pixels


def test_a_picture_without_anything_brighter_than_white_stays_the_very_same(caster):
    pixels = dark(level=239)
    assert with_glare(caster, FILM, pixels, 100.0, 100.0) is pixels
    assert light_of_codes(2.2)[239] < WHITE + 0.05


@pytest.mark.parametrize("bloom", [0.5, 2.0])
def test_all_scattered_light_arrives(caster, bloom):
    pixels = dark((128, 252, (255, 250, 255)))
    light = scattered_light(caster, FILM, pixels, bloom, 0.0)
    beyond = (light_of_codes(2.2)[[255, 250, 255]].astype(float) - WHITE) ** 2
    assert light.sum(axis=(0, 1)) == pytest.approx(bloom * BLOOM_SHARE * beyond, rel=1e-3)


@pytest.mark.parametrize("shift", [0, 4, 12, 28, 33])
def test_glare_falls_off_with_the_distance_alike_wherever_the_lamp_is(caster, shift):
    light = scattered_light(caster, FILM, dark((128 + shift, 252 + shift, (255,) * 3)), 1.0, 0.0)
    row, column = (128 + shift) // 4, (252 + shift) // 4
    ways = np.array(
        [
            light[row, column : column + 10, 0],
            light[row, column : column - 10 : -1, 0],
            light[row : row + 10, column, 0],
            light[row : row - 10 : -1, column, 0],
        ]
    )
    assert (np.diff(ways, axis=1) <= 1e-7).all()
    # Between r^-1 and r^-3, as in lenses and eyes.
    slope = np.log(ways[:, 8].mean() / ways[:, 2].mean()) / np.log(8 / 2)
    assert -3.0 < slope < -1.0
    assert ways[:, 5].max() < 1.6 * ways[:, 5].min()


def test_a_red_lamp_has_a_red_halo(caster):
    pixels = dark((128, 252, (10, 10, 250)))
    shown = with_glare(caster, FILM, pixels, 0.675, 0.0)
    change = shown.astype(int) - pixels
    assert (change[..., 2] > 2).sum() > 100
    assert not change[..., [0, 1, 3]].any()


def test_far_pixels_keep_their_codes_and_none_gets_darker(caster):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 200, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    pixels[100:103, 100:103, :3] = 255
    shown = with_glare(caster, FILM, pixels, 0.675, 0.0)
    assert (shown[..., :3] >= pixels[..., :3]).all()
    assert np.array_equal(shown[:, -100:], pixels[:, -100:])


def test_ghosts_lie_on_the_line_through_the_middle(caster):
    lamp, middle = np.array([66, 98]), np.array([HEIGHT, WIDTH]) / 2.0
    pixels = dark((64, 96, (255,) * 3))
    ghosts = scattered_light(caster, FILM, pixels, 0.0, 1.0)
    bright = (light_of_codes(2.2)[255].astype(float) - WHITE) ** 2
    assert ghosts.sum(axis=(0, 1)) == pytest.approx([GHOST_SHARE * bright] * 3, rel=0.1)
    where = np.argwhere(ghosts.sum(axis=2) > 0) * 4 + 2 - middle
    along = (lamp - middle) / np.hypot(*(lamp - middle))
    beside = where[:, 0] * along[1] - where[:, 1] * along[0]
    weight = ghosts.sum(axis=2)[ghosts.sum(axis=2) > 0]
    for one in (where @ along < -130.0, abs(where @ along + 90.0) < 40.0, where @ along > 20.0):
        assert weight[one].sum() > 0
        # Light is spread over blocks of 16 pixels; its middle is not.
        assert abs(np.average(beside[one], weights=weight[one])) < 8.0


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (37, 601), (600, 1200)])
def test_pictures_of_all_sizes_are_alike_with_all_threads(caster, size):
    pixels = np.random.default_rng(2).integers(0, 256, (*size, 4), dtype=np.uint8)
    pixels[0, 0] = 255
    shown = with_glare(caster, FILM, pixels, 0.675, 1.0)
    assert np.array_equal(shown[..., 3], pixels[..., 3])
    for threads in (1, 3):
        with closing(RayCaster(threads)) as other:
            assert np.array_equal(with_glare(other, FILM, pixels, 0.675, 1.0), shown)


@pytest.fixture(scope="module")
def sensors():
    with closing(WorldSensors(load_town("Stage01"), threads=2)) as made:
        yield made


def towards_sun(sensors, **attributes: str) -> np.ndarray:
    """A picture with the sun in its middle."""
    town = load_town("Stage01")
    world = World(town, 1)
    weather = Weather(sun_altitude_angle=40.0, sun_azimuth_angle=90.0)
    world.set_weather(weather)
    east, south, up = SkyModel().lighting(weather, 0.0).sun_direction.tolist()
    turn = (math.degrees(math.asin(up)), math.degrees(math.atan2(south, east)), 0.0)
    x, y, z, _, _, _ = town.spawn_points[0].tolist()
    state = world.tick(0.05).state
    given = {"image_size_x": "160", "image_size_y": "120", "fov": "30", **attributes}
    request = SensorRequest(9, "sensor.camera.rgb", given, (x, y, z + 40.0), turn, 0)
    sensors.reset()
    ((_, shown),) = sensors.capture(state, [request])
    return shown.pixels.copy()


def test_a_camera_has_the_glare_that_its_attributes_ask_for(sensors):
    without = towards_sun(sensors, bloom_intensity="0", lens_flare_intensity="0")
    assert (without[..., :3] == 255).all(axis=-1).any(), "the sun is to be seen"
    assert np.array_equal(towards_sun(sensors, enable_postprocess_effects="False"), without)
    usual = towards_sun(sensors).astype(int) - without
    assert usual.min() == 0
    assert usual.any()
    assert np.array_equal(
        towards_sun(sensors),
        towards_sun(sensors, bloom_intensity="0.675", lens_flare_intensity="0.1"),
    )
    more = towards_sun(sensors, bloom_intensity="2").astype(int) - without
    assert more.sum() > 1.5 * usual.sum()
