"""Light of weathers: where the sun stands, and what clouds and night take away."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.render.film import Film
from carstage_sim.render.sky import COLUMNS, ROWS, SkyModel
from carstage_sim.world.state import Weather

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Share of each of sRGB's primaries."""


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


def daylight_klx(light, altitude, cloudiness):
    """Illuminance of a surface that faces the sun, and of the ground by the sky alone."""
    found = light(sun_altitude_angle=altitude, cloudiness=cloudiness)
    klx = 127.5 / 20.0 * LUMINANCE
    elevation = (np.arange(ROWS) / (ROWS - 1)) ** 2 * (np.pi / 2)
    ring = found.sky.astype(float).mean(axis=1) @ klx
    sky = 2 * np.pi * np.trapezoid(ring * np.sin(elevation) * np.cos(elevation), elevation)
    return float(found.sun @ klx), float(sky)


@pytest.mark.parametrize("altitude", [5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0])
@pytest.mark.parametrize(
    ("cloudiness", "extinction", "zenith_klx"),
    [(55.0, 0.80, 45.0), (90.0, np.inf, 21.0), (100.0, np.inf, 21.0)],
    ids=["partly cloudy", "overcast", "all overcast"],
)
def test_sun_and_sky_under_clouds_are_as_strong_as_the_ies_has_them(
    light, altitude, cloudiness, extinction, zenith_klx
):
    """Recommended practice for the calculation of daylight availability, 1984."""
    sun, sky = daylight_klx(light, altitude, cloudiness)
    high = np.sin(np.radians(altitude))
    assert sun == pytest.approx(127.5 * np.exp(-extinction / high), rel=0.01, abs=0.01)
    assert sky == pytest.approx(0.3 + zenith_klx * high, rel=0.01)


@pytest.mark.parametrize(
    ("altitude", "sun_times", "sky_times"), [(5.0, 3.1, 1.3), (20.0, 1.3, 1.1), (60.0, 1.1, 0.9)]
)
def test_a_clear_sun_is_stronger_than_the_ies_has_it(light, altitude, sun_times, sky_times):
    """Extinction 0.21, and 0.8 + 15.5 sin(h)^0.5 klx: what is known to be off."""
    sun, sky = daylight_klx(light, altitude, 0.0)
    high = np.sin(np.radians(altitude))
    assert sun / (127.5 * np.exp(-0.21 / high)) == pytest.approx(sun_times, abs=0.05)
    assert sky / (0.8 + 15.5 * high**0.5) == pytest.approx(sky_times, abs=0.05)


@pytest.mark.parametrize("altitude", [1.0, 5.0, 20.0, 60.0])
def test_light_changes_evenly_from_clear_to_overcast(light, altitude):
    klx = np.array([daylight_klx(light, altitude, 5.0 * k) for k in range(21)])
    assert np.all(np.abs(np.diff(klx, axis=0)).max(axis=0) < 0.2 * klx.max(axis=0))


@pytest.mark.parametrize("cloudiness", [55.0, 100.0])
def test_light_under_clouds_changes_evenly_into_the_night(light, cloudiness):
    _, sky = np.array([daylight_klx(light, 0.5 * k, cloudiness) for k in range(-20, 21)]).T
    assert np.all(np.diff(sky) > 0.0)
    assert np.diff(sky).max() < 0.15 * sky[-1]


def test_haze_dims_the_sun_under_clouds(light):
    usual, hazy = (light(cloudiness=55.0, mie_scattering_scale=scale).sun for scale in (0.03, 0.15))
    assert 0.0 < hazy.max() < 0.95 * usual.max()


def test_a_camera_makes_up_for_most_of_what_clouds_take_by_day(light):
    def on_film(**weather):
        found = light(**weather)
        ground = found.ambient[0] + found.sun * found.sun_direction[2]
        return float(ground.mean() * found.exposure)

    noon = on_film(cloudiness=0.0)
    assert on_film(cloudiness=100.0) / noon == pytest.approx(0.59, abs=0.01)
    assert on_film(cloudiness=0.0, sun_altitude_angle=15.0) < 0.7 * noon, "the sun still shines"


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


def test_a_camera_adapts_to_what_fog_in_rain_throws_back_of_the_lamps_light(light):
    def exposure(**weather):
        return float(light(sun_altitude_angle=-90.0, cloudiness=100.0, **weather).exposure)

    dry = exposure(fog_density=100.0)
    assert exposure(fog_density=100.0, precipitation=100.0) < 0.85 * dry
    assert exposure(fog_density=0.0, precipitation=100.0) > 0.95 * dry, "less of it is seen"


@pytest.mark.parametrize(
    ("weather", "iso"),
    [
        (Weather(cloudiness=5.0, sun_altitude_angle=-90.0), 2060.0),
        (
            Weather(
                cloudiness=100.0, sun_altitude_angle=-90.0, precipitation=100.0, fog_density=100.0
            ),
            2620.0,
        ),
    ],
    ids=["clear night", "heavy rain"],
)
def test_nights_take_the_sensitivities_that_the_documentation_says(weather, iso):
    light = SkyModel().lighting(weather, 0.0)
    assert Film().sensitivity(light) == pytest.approx(iso, rel=0.01)


def test_half_of_the_heaviest_rain_throws_nearly_as_much_lamplight_back(light):
    none, half, all_ = (
        light(sun_altitude_angle=-90.0, precipitation=rain).fog.astype(float)
        for rain in (0.0, 50.0, 100.0)
    )
    assert (half - none) / (all_ - none) == pytest.approx(0.88, abs=0.01)


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
