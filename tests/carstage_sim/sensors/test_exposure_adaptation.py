"""Colour cameras that follow a change of the weather in the time that their attributes give."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.render.film import Film
from carstage_sim.render.sky import SkyModel
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.adaptation import Adaptation
from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.sensors.cameras import RgbCamera
from carstage_sim.world.state import Weather
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_NOON, _NIGHT = Weather(sun_altitude_angle=45.0), Weather(sun_altitude_angle=-90.0)
_STOPS = Film().stops(SkyModel().exposure(_NIGHT)) - Film().stops(SkyModel().exposure(_NOON))
"""What lies between the two."""
_CAR = [(40, (7.0, 1.0, 0.0), 30.0)]


@pytest.fixture(scope="module")
def sensors():
    with WorldSensors(town(GROUND, WALL), threads=2) as made:
        yield made


def pictures(sensors, weathers, delta_s=0.1, **attributes):
    """By tick, what a camera shows while the weather is that of each; None where it rests."""
    sensors.reset()
    camera, seen = request("camera.rgb", **attributes), []
    for tick, weather in enumerate(weathers, 1):
        world = state(tick, weather=weather, vehicles=_CAR, delta_s=delta_s)
        frames = sensors.capture(world, [camera])
        seen.append(frames[0][1].pixels if frames else None)
    return seen


def at_once(sensors, weather, tick, delta_s=0.1, **attributes):
    """What a new camera shows in a tick."""
    sensors.reset()
    world = state(tick, weather=weather, vehicles=_CAR, delta_s=delta_s)
    return sensors.capture(world, [request("camera.rgb", **attributes)])[0][1].pixels


def mean(picture):
    return float(picture[..., :3].mean())


def test_in_one_weather_all_pictures_are_exposed_for_it(sensors):
    seen = pictures(sensors, [_NIGHT] * 3)
    for tick, picture in enumerate(seen, 1):
        assert np.array_equal(picture, at_once(sensors, _NIGHT, tick))


def test_after_dark_falls_pictures_brighten_until_they_are_those_of_the_night(sensors):
    seen = pictures(sensors, [_NOON] * 2 + [_NIGHT] * 12, delta_s=0.5)
    night = [at_once(sensors, _NIGHT, tick, 0.5) for tick in range(1, 15)]
    means = [mean(picture) for picture in seen[2:]]
    assert means[0] < 0.5 * mean(night[2])
    assert (np.diff(means[:9]) > 0).all()
    equal = [np.array_equal(*pair) for pair in zip(seen[2:], night[2:], strict=True)]
    steps = math.ceil(_STOPS / (1.0 * 0.5))
    assert equal == [False] * (steps - 1) + [True] * (13 - steps)


def test_when_it_becomes_light_three_stops_a_second_are_taken_back(sensors):
    seen = pictures(sensors, [_NIGHT] * 2 + [_NOON] * 6, delta_s=0.5)
    noon = [at_once(sensors, _NOON, tick, 0.5) for tick in range(1, 9)]
    assert mean(seen[2]) > 1.3 * mean(noon[2])
    equal = [np.array_equal(*pair) for pair in zip(seen[2:], noon[2:], strict=True)]
    steps = math.ceil(_STOPS / (3.0 * 0.5))
    assert equal == [False] * (steps - 1) + [True] * (7 - steps)


def test_a_camera_that_rests_is_exposed_as_one_that_does_not(sensors):
    dusk = [Weather(sun_altitude_angle=20.0 - 3.0 * tick) for tick in range(6)]
    weathers = [_NOON] * 2 + [_NIGHT] * 8 + [_NOON] * 3 + dusk + [_NIGHT] * 6
    always, rarely = pictures(sensors, weathers), pictures(sensors, weathers, sensor_tick=0.4)
    shown = [tick for tick, picture in enumerate(rarely) if picture is not None]
    assert shown == list(range(0, len(weathers), 4))
    assert all(np.array_equal(always[tick], rarely[tick]) for tick in shown)


def test_a_slow_change_is_followed_without_a_lag(sensors):
    # 0.03 stops a step, where 0.1 are possible.
    weathers = [Weather(sun_altitude_angle=40.0 - tick) for tick in range(8)]
    seen = pictures(sensors, weathers)
    for tick, (weather, picture) in enumerate(zip(weathers, seen, strict=True), 1):
        assert np.array_equal(picture, at_once(sensors, weather, tick))


def test_manual_exposure_does_not_adapt(sensors):
    manual = {"exposure_mode": "manual"}
    seen = pictures(sensors, [_NOON, _NIGHT], **manual)
    assert np.array_equal(seen[1], at_once(sensors, _NIGHT, 2, **manual))


def test_bounds_and_compensation_hold_while_it_adapts(sensors):
    """Nothing changes for a camera that may not leave a clear noon's exposure."""
    bound = {"exposure_min_bright": 12.0, "exposure_compensation": -1.0}
    seen = pictures(sensors, [_NOON, _NIGHT], **bound)
    assert np.abs(seen[1].astype(int) - at_once(sensors, _NIGHT, 2, **bound).astype(int)).max() <= 1


def stops(adaptation, *steps, delta_s=0.5):
    """The exposure in each step, of which each is what its weather asks for."""
    found = []
    for tick, wanted in enumerate(steps, 1):
        world = replace(state(tick, delta_s=delta_s), weather=Weather(cloudiness=wanted))
        found.append(adaptation.stops(world, lambda weather: weather.cloudiness))
    return found


def test_stops_per_second_are_those_of_the_attributes():
    two = Adaptation.of({"exposure_speed_up": "2", "exposure_speed_down": "0.5"})
    assert stops(two, 0.0, 4.0, 4.0, 4.0) == [0.0, 0.25, 0.5, 0.75]
    assert stops(Adaptation.of({}), 0.0, 4.0, 4.0, 0.0) == [0.0, 0.5, 1.0, 0.0]
    assert stops(Adaptation(2.0, 0.5), 4.0, 0.0, 0.0, 2.5, 2.5) == [4.0, 3.0, 2.0, 2.25, 2.5]
    assert stops(Adaptation(0.0, -1.0), 4.0, 0.0, 9.0) == [4.0, 4.0, 4.0]


def test_a_picture_that_is_made_late_knows_nothing_of_later_steps():
    adaptation = Adaptation(3.0, 1.0)

    def step(tick, wanted):
        return replace(state(tick, delta_s=0.5), weather=Weather(cloudiness=wanted))

    def wanted(weather):
        return weather.cloudiness

    assert adaptation.stops(step(1, 4.0), wanted) == 4.0
    adaptation.note(step(3, 0.0))
    assert adaptation.stops(step(2, 4.0), wanted) == 4.0
    assert adaptation.stops(step(4, 0.0), wanted) == 1.0


class Seen:
    """A view that notes the films of the pictures that are asked for."""

    def __init__(self):
        self.films = []

    def automatic_exposure(self, weather):
        return SkyModel().exposure(weather)

    def announce(self, camera, product, film):
        self.films.append(film)

    def pixels(self, camera, film):
        self.films.append(film)
        return np.zeros((camera.height, camera.width, 4), np.uint8)

    def with_shapes(self, camera, pixels):
        return pixels


def test_a_picture_that_was_announced_has_its_film_though_later_ones_were_announced_since():
    asked = request(
        "camera.rgb",
        exposure_speed_up=4.0,
        exposure_speed_down=2.0,
        enable_postprocess_effects="false",
    )
    camera, view = RgbCamera(asked, town(GROUND, WALL)), Seen()
    steps = [
        state(tick, weather=weather) for tick, weather in enumerate((_NOON, _NIGHT, _NOON, _NOON))
    ]
    for step in steps:
        camera.announce(step, asked, view)
    announced = view.films[:]
    assert len({film.adapted_stops for film in announced}) > 1
    for step in steps:
        camera.measure(step, asked, view)
    assert view.films[4:] == announced


@pytest.mark.parametrize("name", ["exposure_speed_up", "exposure_speed_down"])
def test_a_speed_that_is_no_number_is_refused(sensors, name):
    with pytest.raises(SensorAttributeError, match=name):
        pictures(sensors, [_NOON], **{name: "fast"})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("exposure_min_bright", 490),
        ("exposure_max_bright", -450),
        ("fstop", 1e-160),
        ("iso", 1e12),
        ("shutter_speed", 1e-9),
        ("fstop", 0),
    ],
)
def test_an_exposure_that_no_picture_can_have_is_refused(name, value):
    with pytest.raises(SensorAttributeError, match=name):
        RgbCamera(request("camera.rgb", **{name: value}), town(GROUND, WALL))


@pytest.mark.parametrize(
    ("code", "attributes"),
    [
        (0, {"exposure_min_bright": 30, "exposure_compensation": -30}),
        (255, {"exposure_max_bright": -10, "exposure_compensation": 30}),
        (0, {"exposure_mode": "manual", "fstop": 1e6, "shutter_speed": 1e6, "iso": 0.01}),
        (255, {"exposure_mode": "manual", "fstop": 0.01, "shutter_speed": 0.01, "iso": 1e6}),
    ],
)
def test_the_extremes_of_exposure_are_black_and_white(sensors, code, attributes):
    (seen,) = pictures(sensors, [_NOON], **attributes)
    assert set(np.unique(seen[-8:, :, :3]).tolist()) == {code}, "the ground"
