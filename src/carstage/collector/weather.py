"""The weather: presets of the client, single values on top, and how it changes over time."""

from __future__ import annotations

import difflib
from typing import Any, Dict, List, Mapping, Sequence, Tuple

import carla

from carstage.collector.internals.dialect import weather_values
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.snapshots import WEATHER_PARAMETERS
from carstage.spec import WeatherChange, WeatherSpec

Values = Dict[str, float]


class Timeline:
    """Values over time: linear between moments, constant before the first and after the last.

    Args:
        moments: time (s) and values, ascending; all with the same names.
    """

    def __init__(self, moments: Sequence[Tuple[float, Mapping[str, float]]]) -> None:
        self._moments = list(moments)

    @property
    def changes(self) -> bool:
        """Whether there is more than one moment."""
        return len(self._moments) > 1

    def at(self, time_s: float) -> Values:
        """The values at a time."""
        begin_s, before = self._moments[0]
        for end_s, after in self._moments[1:]:
            if time_s < end_s:
                share = max(0.0, (time_s - begin_s) / (end_s - begin_s))
                return {name: before[name] + share * (after[name] - before[name]) for name in after}
            begin_s, before = end_s, after
        return dict(before)


class Weather:
    """Sets the planned weather and knows what was set last.

    Args:
        world: ``carla.World``.
        plan: the weather at the first step and its changes.

    Raises:
        SceneError: unknown preset or parameter.
    """

    def __init__(self, world: Any, plan: WeatherSpec) -> None:
        self._world = world
        self._timeline = planned_timeline(plan)
        self.values: Mapping[str, float] = {}
        self._set(self._timeline.at(0.0))

    def advance(self, time_s: float) -> None:
        """Set the weather of the step that comes next, ``time_s`` after the first recorded one."""
        if self._timeline.changes:
            values = self._timeline.at(time_s)
            if values != self._planned:
                self._set(values)

    def _set(self, values: Values) -> None:
        weather = carla.WeatherParameters()
        for name, value in values.items():
            setattr(weather, name, value)
        self._world.set_weather(weather)
        self._planned = values
        # As the client rounds them, and the server gets them.
        self.values = weather_values(weather, WEATHER_PARAMETERS)


def planned_timeline(plan: WeatherSpec) -> Timeline:
    """The weather's values over the recorded time.

    Raises:
        SceneError: unknown preset or parameter.
    """
    usual = weather_values(carla.WeatherParameters(), WEATHER_PARAMETERS)
    values = _values(plan.begin, usual, "weather")
    moments: List[Tuple[float, Values]] = [(0.0, values)]
    for index, change in enumerate(plan.changes):
        values = _values(change, values, "weather.changes[%d]" % index)
        if change.at_s <= 0.0:
            moments.clear()
        moments.append((max(0.0, change.at_s), values))
    return Timeline(moments)


def _values(moment: WeatherChange, before: Values, path: str) -> Values:
    values = dict(before)
    if moment.preset is not None:
        presets = {
            name: value
            for name, value in vars(carla.WeatherParameters).items()
            if isinstance(value, carla.WeatherParameters)
        }
        if moment.preset not in presets:
            raise _unknown(path + ".preset", moment.preset, presets)
        values = weather_values(presets[moment.preset], WEATHER_PARAMETERS)
    for name, value in moment.parameters.items():
        if name in WEATHER_PARAMETERS and name not in values and value == 0.0:
            continue  # an older client lacks it, and its weather has none of it
        if name not in WEATHER_PARAMETERS or name not in values:
            raise _unknown(path + ".parameters", name, values)
        values[name] = value
    return values


def _unknown(path: str, name: str, known: Any) -> SceneError:
    near = difflib.get_close_matches(name, list(known), n=1)
    return SceneError(
        "%s: this CARLA client does not know %r." % (path, name),
        "Did you mean %s?" % near[0] if near else "It knows: %s." % ", ".join(sorted(known)),
    )
