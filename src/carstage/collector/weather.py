"""The weather: a preset of the client, single values on top."""

from __future__ import annotations

import difflib
from typing import Any, Dict

import carla

from carstage.collector.errors import SceneError
from carstage.collector.plan import WeatherPlan
from carstage.collector.snapshots import WEATHER_PARAMETERS, weather_values


def set_weather(world: Any, plan: WeatherPlan) -> Dict[str, float]:
    """Set the planned weather; return the values that the server then reports.

    Raises:
        SceneError: unknown preset or parameter.
    """
    world.set_weather(planned_weather(plan))
    return weather_values(world.get_weather())


def planned_weather(plan: WeatherPlan) -> Any:
    """The ``carla.WeatherParameters`` that the plan describes.

    Raises:
        SceneError: unknown preset or parameter.
    """
    weather = carla.WeatherParameters()
    if plan.preset is not None:
        presets = {
            name: value
            for name, value in vars(carla.WeatherParameters).items()
            if isinstance(value, carla.WeatherParameters)
        }
        if plan.preset not in presets:
            raise _unknown("weather.preset", plan.preset, presets)
        for name, value in weather_values(presets[plan.preset]).items():
            setattr(weather, name, value)
    for name, value in plan.parameters.items():
        if name not in WEATHER_PARAMETERS or not hasattr(weather, name):
            raise _unknown("weather.parameters", name, WEATHER_PARAMETERS)
        setattr(weather, name, value)
    return weather


def _unknown(path: str, name: str, known: Any) -> SceneError:
    near = difflib.get_close_matches(name, list(known), n=1)
    return SceneError(
        "%s: this CARLA client does not know %r." % (path, name),
        "Did you mean %s?" % near[0] if near else "It knows: %s." % ", ".join(sorted(known)),
    )
