"""Colour cameras that are asked for it have the noise of a sensor; no others."""

from __future__ import annotations

import hashlib
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.maps import load_town
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.crew import alone
from carstage_sim.render.film import Film, display_of_codes, film_codes, light_of_codes
from carstage_sim.render.sensor_noise import (
    FULL_WELL,
    READ_NOISE,
    draw_noise,
    noise_key,
    noise_table,
)
from carstage_sim.render.sky import SkyModel
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.world.state import Weather
from carstage_sim.world.world import World

pytestmark = pytest.mark.xdist_group("kernels")

NOON, NIGHT = Weather(sun_altitude_angle=45.0), Weather(sun_altitude_angle=-90.0)


def noisy(code: int, iso: float, key: int, count: int = 100_000) -> np.ndarray:
    clean = np.full((count, 4), code, np.uint8)
    clean[:, 3] = 255
    result = np.empty_like(clean)
    alone(draw_noise, (noise_table(iso, 2.2), np.uint32(key), clean, result), 0, count)
    return result


@pytest.mark.parametrize("gamma", [1.8, 2.2])
def test_codes_are_those_of_the_light_that_stands_for_them(gamma):
    display, light = display_of_codes(gamma), light_of_codes(gamma).astype(float)
    every = np.arange(256)
    assert np.array_equal(film_codes(gamma)[np.rint(display * 8191).astype(int)], every)
    shown = 1.0 - np.exp(-light)
    assert np.array_equal(film_codes(gamma)[np.rint(shown * 8191).astype(int)], every)


def test_noise_leaves_no_dark_wall_flat_by_night():
    """Bricks of a wall of 12 codes differ by less than one: noise of three electrons is nine."""
    iso = Film().sensitivity(SkyModel().lighting(NIGHT, 0.0))
    patch = noisy(12, iso, 5, 32 * 32)[:, :3]
    assert patch.astype(float).std() > 3.0


@pytest.mark.parametrize("iso", [800.0, 3200.0])
def test_variance_grows_with_the_light_as_that_of_counted_electrons(iso):
    electrons = FULL_WELL * 100.0 / iso
    light = light_of_codes(2.2).astype(float)
    mean, variance = [], []
    for code in (60, 90, 120, 150, 180):
        shown = light[noisy(code, iso, code)[:, :3]]
        mean.append(shown.mean() * electrons)
        variance.append(shown.var() * electrons**2)
        assert shown.mean() == pytest.approx(light[code], rel=0.02)
    slope, beside = np.polyfit(mean, variance, 1)
    # EMVA 1288's photon transfer: in electrons the slope is 1, and the rest is what is read.
    assert slope == pytest.approx(1.0, abs=0.04)
    # The rounding to codes adds a little.
    assert READ_NOISE**2 - 3.0 < beside < READ_NOISE**2 + 0.02 * max(mean)


def test_colours_of_a_pixel_have_noise_of_their_own():
    together = np.corrcoef(noisy(120, 2000.0, 5)[:, :3].T.astype(float))
    assert abs(together[np.triu_indices(3, 1)]).max() < 0.02


def test_each_frame_of_each_seed_has_its_own_noise_and_the_same_again():
    base = noisy(90, 2000.0, noise_key(7, 12))[:, 0].astype(float)
    assert np.array_equal(base, noisy(90, 2000.0, noise_key(7, 12))[:, 0])
    for key in (noise_key(8, 12), noise_key(7, 13)):
        other = noisy(90, 2000.0, key)[:, 0].astype(float)
        assert abs(np.corrcoef(base, other)[0, 1]) < 0.02


def test_noise_has_the_same_bytes_on_every_machine_and_with_all_threads():
    pixels = noisy(90, 2000.0, noise_key(7, 12), 40_000)
    assert hashlib.sha256(pixels.tobytes()).hexdigest()[:16] == "5f69b1c2ad2971b3"
    clean, shared = np.full_like(pixels, 90), np.empty_like(pixels)
    clean[:, 3] = 255
    with closing(RayCaster(3)) as caster:
        data = noise_table(2000.0, 2.2), np.uint32(noise_key(7, 12)), clean, shared
        caster.in_parts(draw_noise, data, len(clean))
    assert np.array_equal(shared, pixels)


@pytest.fixture(scope="module")
def sensors():
    with closing(WorldSensors(load_town("Stage01"), threads=2)) as made:
        yield made


def shots(sensors, weather, **attributes):
    """Pictures of one place in two frames, and in the first again."""
    town = load_town("Stage01")
    world = World(town, 1)
    world.set_weather(weather)
    x, y, z, _, yaw, _ = town.spawn_points[0].tolist()
    given = {"image_size_x": "64", "image_size_y": "48", **attributes}
    request = SensorRequest(9, "sensor.camera.rgb", given, (x, y, z), (0.0, yaw, 0.0), 0)
    state = world.tick(0.05).state
    pictures = []
    for frame in (state.frame, state.frame + 1, state.frame):
        sensors.reset()
        ((_, shown),) = sensors.capture(replace(state, frame=frame), [request])
        pictures.append(shown.pixels.copy())
    assert np.array_equal(pictures[0], pictures[2])
    return pictures


def test_a_camera_has_noise_on_request_alone(sensors):
    clean, also, _ = shots(sensors, NIGHT)
    assert np.array_equal(clean, also)
    first, second, _ = shots(sensors, NIGHT, sensor_noise="true")
    assert not np.array_equal(first, second)
    assert (first[..., 3] == 255).all()
    off = (first.astype(float) - clean)[..., :3]
    assert 1.0 < off.std() < 20.0
    other, *_ = shots(sensors, NIGHT, sensor_noise="true", noise_seed="5")
    assert not np.array_equal(first, other)
    day, *_ = shots(sensors, NOON)
    noisy_day, *_ = shots(sensors, NOON, sensor_noise="true")
    assert (noisy_day.astype(float) - day).std() < 0.5 * off.std()


def test_a_request_that_is_neither_true_nor_false_is_refused(sensors):
    with pytest.raises(SensorAttributeError, match="sensor_noise"):
        shots(sensors, NIGHT, sensor_noise="much")


def test_sensitivity_is_what_the_exposure_takes():
    sky = SkyModel()
    assert Film().sensitivity(sky.lighting(NIGHT, 0.0)) > 1000.0
    brighter = Film(compensation_ev=1.0).sensitivity(sky.lighting(NOON, 0.0))
    assert brighter == pytest.approx(2.0 * Film().sensitivity(sky.lighting(NOON, 0.0)))
    assert Film(manual=True, iso=400.0).sensitivity(sky.lighting(NIGHT, 0.0)) == 400.0
