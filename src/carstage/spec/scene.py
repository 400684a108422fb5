"""Where an episode plays: the weather, and the ego vehicle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import List, Mapping, Optional, Tuple

from carstage.spec.comfort import ComfortSpec
from carstage.spec.drivers import DriverSpec, read_driver
from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

_COLOUR_MAX = 255
_SLACK_S = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Place(Value):
    """A place on the map in CARLA's world axes (m); the height is the road's."""

    x_m: float
    y_m: float


@dataclass(frozen=True, eq=False, repr=False)
class Stand(Value):
    """A place and a heading in CARLA's world axes: metres and degrees."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float


@dataclass(frozen=True, eq=False, repr=False)
class WeatherChange(Value):
    """The weather from ``at_s`` on: a preset (or none) and values that override it."""

    at_s: float
    preset: Optional[str]
    parameters: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class WeatherSpec(Value):
    """The weather at the first step, what it becomes later, and when lamps shine.

    Attributes:
        preset: name of a preset of the client; None: the map's own weather.
        parameters: values that override the preset, by the client's names.
        lights: ``auto``, ``on`` or ``off``.
        changes: later weathers, ascending.
    """

    preset: Optional[str]
    parameters: Mapping[str, float]
    lights: str
    changes: Tuple[WeatherChange, ...] = ()

    @classmethod
    def read(cls, fields: Fields) -> WeatherSpec:
        """Check and read the section."""
        changes: List[WeatherChange] = []
        for change in fields.objects("changes"):
            changes.append(
                WeatherChange(
                    at_s=change.number("at_s", changes[-1].at_s if changes else None, least=0.0),
                    preset=change.text("preset") if "preset" in change else None,
                    parameters=change.numbers("parameters"),
                )
            )
        return cls(
            preset=fields.text("preset") if "preset" in fields else None,
            parameters=fields.numbers("parameters"),
            lights=fields.text("lights", ("auto", "on", "off")),
            changes=tuple(changes),
        )

    def preset_at(self, time_s: float) -> Optional[str]:
        """The preset of the weather at a time; None while it moves from one weather to another."""
        moments = (self.begin, *self.changes)
        before = max(i for i, moment in enumerate(moments) if moment.at_s <= time_s + _SLACK_S)
        now = moments[before]
        if before + 1 == len(moments) or abs(time_s - now.at_s) <= _SLACK_S:
            return now.preset
        after = moments[before + 1]
        still = (now.preset, now.parameters) == (after.preset, after.parameters)
        return now.preset if still else None

    @property
    def begin(self) -> WeatherChange:
        """The weather at the first step."""
        return WeatherChange(0.0, self.preset, self.parameters)


@dataclass(frozen=True, eq=False, repr=False)
class EgoSpec(Value):
    """What carries the sensors of the ego, or of an agent beside it.

    Attributes:
        blueprint: CARLA's id.
        color: red, green, blue from 0 to 255; None: one that the blueprint recommends.
        spawn_index: the spawn point it begins at; None with ``spawn_place`` and ``near_ego``.
        spawn_place: or where else it begins.
        driver: who drives it; None: the Traffic Manager, or what the scenario says.
        near_ego: of an agent: it begins at the free spawn point that is nearest to the ego's.
        is_vehicle: false for what carries the sensors of an agent that is none.
        comfort: how gently the Traffic Manager drives it; None: as it does by itself.
    """

    blueprint: str
    color: Optional[Tuple[int, int, int]]
    spawn_index: Optional[int]
    spawn_place: Optional[Stand]
    driver: Optional[DriverSpec] = field(default=None, metadata=LEFT_OUT)
    near_ego: bool = field(default=False, metadata=LEFT_OUT)
    is_vehicle: bool = field(default=True, metadata=LEFT_OUT)
    comfort: Optional[ComfortSpec] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> EgoSpec:
        """Check and read the section."""
        near_ego = fields.flag("near_ego") if "near_ego" in fields else False
        is_vehicle = fields.flag("is_vehicle") if "is_vehicle" in fields else True
        place = fields.object("spawn_place") if "spawn_place" in fields else None
        color = fields.list("color") if "color" in fields else None
        if color is not None and (
            len(color) != 3
            or not all(type(part) is int and 0 <= part <= _COLOUR_MAX for part in color)
        ):
            raise SpecError("%s: must be three numbers from 0 to 255." % fields.path("color"))
        return cls(
            blueprint=fields.text("blueprint"),
            color=None if color is None else (color[0], color[1], color[2]),
            spawn_index=fields.integer("spawn_index", 0)
            if place is None and is_vehicle and not near_ego
            else None,
            spawn_place=None
            if place is None
            else Stand(*(place.number(name) for name in ("x_m", "y_m", "z_m", "yaw_deg"))),
            driver=read_driver(fields.object("driver")) if "driver" in fields else None,
            near_ego=near_ego,
            is_vehicle=is_vehicle,
            comfort=ComfortSpec.read(fields.object("comfort")) if "comfort" in fields else None,
        )
