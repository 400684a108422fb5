"""Light of weathers: where the sun stands, and what clouds and night take away."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.render.sky import COLUMNS, ROWS, SkyModel
from carstage_sim.world.state import Weather


@pytest.fixture(scope="module")
def light():
    model = SkyModel()
    return lambda **weather: model.lighting(Weather(**weather), 0.0)


def test_the_sun_stands_at_its_altitude_and_azimuth(light):
    east = light(sun_altitude_angle=30.0, sun_azimuth_angle=90.0)
    assert east.sun_direction.tolist() == pytest.approx([0.0, 0.8660254, 0.5], abs=1e-6)


def test_a_low_sun_is_weaker_and_redder(light):
    high, low = light(sun_altitude_angle=60.0), light(sun_altitude_angle=5.0)
    assert low.sun[2] < 0.5 * high.sun[2]
    assert low.sun[0] / low.sun[2] > 2 * high.sun[0] / high.sun[2]


def test_clouds_take_the_sun_and_leave_the_sky(light):
    clear, overcast = light(cloudiness=0.0), light(cloudiness=100.0)
    assert overcast.sun.max() < 0.1 * clear.sun.max()
    assert overcast.ambient[0].mean() > clear.ambient[0].mean()


def test_the_clear_sky_is_blue_overhead_and_brighter_near_the_sun(light):
    sky = light(sun_altitude_angle=40.0, sun_azimuth_angle=0.0, cloudiness=0.0).sky
    assert sky.shape == (ROWS, COLUMNS, 3)
    assert sky[-1, :, 2].mean() > 2 * sky[-1, :, 0].mean()
    row = int(ROWS * np.sqrt(40 / 90))
    assert sky[row, 0].mean() > 2 * sky[row, COLUMNS // 2].mean()


def test_lamps_are_on_by_night_only(light):
    assert light(sun_altitude_angle=45.0).night == 0.0
    assert light(sun_altitude_angle=-30.0).night == 1.0


@pytest.mark.parametrize("altitude", [-90.0, -10.0, 0.0, 1.0, 45.0, 90.0])
@pytest.mark.parametrize("cloudiness", [0.0, 50.0, 100.0])
def test_light_is_finite_and_never_negative(light, altitude, cloudiness):
    result = light(
        sun_altitude_angle=altitude, cloudiness=cloudiness, fog_density=80.0, dust_storm=30.0
    )
    for array in (result.sun, result.sky, result.ambient, result.fog, result.exposure):
        assert np.all(np.isfinite(array))
        assert np.all(array >= 0)


def test_unchanged_weather_keeps_its_sky(light):
    assert light(cloudiness=10.0).sky is light(cloudiness=10.0).sky


def test_stars_are_seen_on_clear_nights_only(light):
    night = light(sun_altitude_angle=-60.0, cloudiness=0.0)
    assert night.stars > 0.5 * night.lamp
    assert light(sun_altitude_angle=30.0, cloudiness=0.0).stars == 0.0
    assert light(sun_altitude_angle=-60.0, cloudiness=80.0).stars == 0.0
    assert light(sun_altitude_angle=-60.0, cloudiness=0.0, precipitation=60.0).stars == 0.0


def test_by_night_the_towns_light_stands_above_the_horizon(light):
    sky = light(sun_altitude_angle=-60.0, cloudiness=0.0).sky.mean(axis=1)
    assert sky[0].mean() > 2.0 * sky[-1].mean()
    assert sky[0, 0] > sky[0, 2], "the lamps are warm"
    assert np.all(np.diff(sky[:, 0]) <= 1e-6)


def daylight(kelvin):
    """Linear sRGB of the CIE daylight of a colour temperature (CIE 15, 4,000 to 25,000 K)."""
    t = 1e3 / kelvin
    if kelvin <= 7000:
        x = -4.6070 * t**3 + 2.9678 * t**2 + 0.09911 * t + 0.244063
    else:
        x = -2.0064 * t**3 + 1.9018 * t**2 + 0.24748 * t + 0.237040
    y = -3.0 * x**2 + 2.870 * x - 0.275
    xyz = np.array([x / y, 1.0, (1.0 - x - y) / y])
    matrix = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    return np.array(matrix) @ xyz


@pytest.mark.parametrize("altitude", [20.0, 45.0, 70.0])
def test_clear_shade_is_as_blue_as_daylight_of_7000_to_10000_kelvin(light, altitude):
    """Beside sunlight above the air, of 5,800 K, which is white here."""
    shade = light(sun_altitude_angle=altitude, cloudiness=5.0).ambient[0]
    least, most = (daylight(kelvin) / daylight(5800.0) for kelvin in (10_000.0, 7_000.0))
    assert least[0] / least[2] < shade[0] / shade[2] < most[0] / most[2]


def test_sun_and_sky_together_are_nearly_white_at_noon(light):
    noon = light(sun_altitude_angle=45.0, cloudiness=5.0)
    ground = noon.ambient[0] + noon.sun * noon.sun_direction[2]
    assert ground / ground.mean() == pytest.approx(np.ones(3), abs=0.07)


def test_walls_in_the_sun_warm_the_shade_more_than_a_covered_sky(light):
    """Less of a clear sky's blue is left in a street than of the sky itself."""
    clear = light(sun_altitude_angle=45.0, cloudiness=0.0)
    sky = clear.sky.mean(axis=1)[ROWS // 2 :].mean(axis=0)
    assert clear.ambient[0, 0] / clear.ambient[0, 2] > 1.15 * sky[0] / sky[2]
