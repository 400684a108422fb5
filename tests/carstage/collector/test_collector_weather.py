"""The weather over time, and what lamps do in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

pytest.importorskip("carla")

import carla

from carstage.collector.internals.dialect import weather_values
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.lamps import DRIVING_LIGHTS, lights_for
from carstage.collector.weather import Timeline, planned_timeline
from carstage.spec import WeatherChange, WeatherSpec


def plan(*changes: WeatherChange, preset: str | None = "ClearNoon", **values: float) -> WeatherSpec:
    return WeatherSpec(preset, values, "auto", changes)


def test_values_move_in_straight_lines_and_then_stay() -> None:
    timeline = Timeline([(0.0, {"rain": 0.0}), (2.0, {"rain": 50.0}), (3.0, {"rain": 10.0})])
    seen = [timeline.at(time_s)["rain"] for time_s in (-1.0, 0.0, 0.5, 2.0, 2.5, 3.0, 99.0)]
    assert seen == [0.0, 0.0, 12.5, 50.0, 30.0, 10.0, 10.0]


def test_weather_without_changes_stays() -> None:
    timeline = planned_timeline(plan(cloudiness=33.0))
    assert not timeline.changes
    assert timeline.at(0.0) == timeline.at(50.0)
    assert timeline.at(0.0)["cloudiness"] == 33.0


def test_a_change_keeps_what_it_does_not_name() -> None:
    timeline = planned_timeline(
        plan(WeatherChange(4.0, None, {"fog_density": 60.0}), cloudiness=33.0)
    )
    assert timeline.at(4.0) == {**timeline.at(0.0), "fog_density": 60.0}


def test_a_change_at_the_first_step_is_the_weather_from_the_start() -> None:
    night = planned_timeline(plan(WeatherChange(0.0, "ClearNight", {})))
    expected = carla.WeatherParameters.ClearNight.sun_altitude_angle
    assert night.at(0.0)["sun_altitude_angle"] == expected
    assert not night.changes


@pytest.mark.parametrize(
    ("change", "path"),
    [
        (WeatherChange(1.0, "ClearNon", {}), "weather.changes[0].preset"),
        (WeatherChange(1.0, None, {"snow": 1.0}), "weather.changes[0].parameters"),
    ],
)
def test_unknown_weather_is_refused_with_its_place(change: WeatherChange, path: str) -> None:
    with pytest.raises(SceneError) as caught:
        planned_timeline(plan(change))
    assert caught.value.message.startswith(path)


def test_parameter_that_an_old_client_lacks_may_only_be_zero(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def as_0_9_13(weather: carla.WeatherParameters, names: Sequence[str]) -> dict[str, float]:
        return weather_values(weather, [name for name in names if name != "dust_storm"])

    monkeypatch.setattr("carstage.collector.weather.weather_values", as_0_9_13)
    timeline = planned_timeline(plan(WeatherChange(1.0, None, {"dust_storm": 0.0})))
    assert "dust_storm" not in timeline.at(2.0)
    with pytest.raises(SceneError, match="dust_storm"):
        planned_timeline(plan(WeatherChange(1.0, None, {"dust_storm": 5.0})))


@pytest.mark.parametrize(
    ("values", "bits"),
    [
        ({"sun_altitude_angle": 45.0}, 0),
        ({"sun_altitude_angle": 30.0}, int(carla.VehicleLightState.Position)),
        ({"sun_altitude_angle": 10.0}, DRIVING_LIGHTS),
        ({"sun_altitude_angle": 45.0, "precipitation": 90.0}, DRIVING_LIGHTS),
        (
            {"sun_altitude_angle": 45.0, "fog_density": 30.0},
            DRIVING_LIGHTS | int(carla.VehicleLightState.Fog),
        ),
    ],
)
def test_careful_drivers_light_up_when_the_traffic_manager_does(
    values: dict[str, Any], bits: int
) -> None:
    assert lights_for({"precipitation": 0.0, "fog_density": 0.0, **values}) == bits
