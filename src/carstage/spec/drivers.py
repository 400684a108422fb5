"""Who drives the ego, one class for each kind of driver; without one the Traffic Manager does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, NamedTuple, Optional, Tuple, Type, Union

from carstage.spec.fields import Fields, SpecError, is_number, shown
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

LEFT, STRAIGHT, RIGHT = "left", "straight", "right"
TURNS = (LEFT, STRAIGHT, RIGHT)
DEVICES = ("keyboard", "gamepad", "wheel")
MOST_PARAMETERS = 100

Parameter = Union[str, int, float, bool]


class Command(NamedTuple):
    """What a driver commands for one step, as in ``carla.VehicleControl``; flags are 0 or 1."""

    throttle: float
    steer: float
    brake: float
    hand_brake: int
    reverse: int
    manual_gear_shift: int
    gear: int


class DriverSpec(Value):
    """Who drives the ego.

    Attributes:
        kind: its name.
    """

    kind: str

    @classmethod
    def read(cls, section: Fields) -> DriverSpec:
        """Check and read the section of this kind."""
        raise NotImplementedError


def _named(kind: str) -> Any:
    return field(default=kind, init=False)


@dataclass(frozen=True, eq=False, repr=False)
class RouteDriverSpec(DriverSpec):
    """Car-STAGE's own controller follows the scenario's route, or the road.

    Attributes:
        speed_m_s: at most so fast; None: as the speed limit allows.
        turns: which way to take at the forks behind the route, one after the other.
    """

    kind: str = _named("route")
    speed_m_s: Optional[float] = None
    turns: Tuple[str, ...] = ()

    @classmethod
    def read(cls, section: Fields) -> RouteDriverSpec:
        """Check and read the section."""
        return cls(
            speed_m_s=section.number("speed_m_s", 0.0) if "speed_m_s" in section else None,
            turns=section.words("turns", TURNS),
        )


@dataclass(frozen=True, eq=False, repr=False)
class ClassDriverSpec(DriverSpec):
    """A class of the user's drives.

    Attributes:
        name: ``module:Class``.
        parameters: its keyword arguments.
    """

    kind: str = _named("class")
    name: str = ""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)

    @classmethod
    def read(cls, section: Fields) -> ClassDriverSpec:
        """Check and read the section."""
        name = section.text("name")
        if not is_class_name(name):
            raise SpecError("%s: %r is not module:Class." % (section.path("name"), name))
        return cls(name=name, parameters=read_parameters(section))


@dataclass(frozen=True, eq=False, repr=False)
class DeviceDriverSpec(DriverSpec):
    """A person drives.

    Attributes:
        kind: ``keyboard``, ``gamepad`` or ``wheel``.
        camera: sensor whose pictures the window shows.
        take: number of the drive, so that one scene can be driven several times.
        inputs: numbers of the device's axes and buttons, by what they do; none of a keyboard.
        at_page: the person is at the page, and not at a window of the collector.
    """

    kind: str
    camera: str
    take: int = 1
    inputs: Mapping[str, int] = field(default_factory=dict)
    at_page: bool = field(default=False, metadata=LEFT_OUT)

    @classmethod
    def read(cls, section: Fields) -> DeviceDriverSpec:
        """Check and read the section."""
        inputs = section.object("inputs")
        return cls(
            section.text("kind", DEVICES),
            section.text("camera"),
            section.integer("take", 1),
            {name: inputs.integer(name, 0) for name in section.numbers("inputs")},
            section.flag("at_page") if "at_page" in section else False,
        )


@dataclass(frozen=True, eq=False, repr=False)
class ReplayDriverSpec(DriverSpec):
    """The commands of an earlier episode drive once more.

    Attributes:
        episode_id: that episode's.
        commands: one for each step.
    """

    kind: str = _named("replay")
    episode_id: str = ""
    commands: Tuple[Command, ...] = ()

    @classmethod
    def read(cls, section: Fields) -> ReplayDriverSpec:
        """Check and read the section."""
        path = section.path("commands")
        commands = tuple(
            _command(value, "%s[%d]" % (path, index))
            for index, value in enumerate(section.list("commands"))
        )
        return cls(episode_id=section.text("episode_id"), commands=commands)


def is_class_name(text: str) -> bool:
    """Whether a text is ``module:Class``; the module may lie in packages."""
    module, colon, name = text.partition(":")
    return bool(colon) and all(part.isidentifier() for part in (*module.split("."), name))


def read_parameters(section: Fields) -> Mapping[str, Parameter]:
    """Check and read ``parameters`` of a section: words, numbers and flags by name."""
    if "parameters" not in section:
        return {}
    given = section.any("parameters")
    path = section.path("parameters")
    if not isinstance(given, dict) or len(given) > MOST_PARAMETERS:
        raise SpecError("%s: must be an object of at most %d." % (path, MOST_PARAMETERS))
    for name, value in given.items():
        if not (is_number(value) or isinstance(value, (str, bool))):
            raise SpecError(
                "%s.%s: must be a text, a number or a flag, not %s." % (path, name, shown(value))
            )
    return dict(given)


def _command(value: Any, path: str) -> Command:
    count = len(Command._fields)
    if not (isinstance(value, list) and len(value) == count and all(map(is_number, value))):
        raise SpecError("%s: must be %d numbers, not %s." % (path, count, shown(value)))
    throttle, steer, brake, *flags = value
    if not all(type(flag) is int for flag in flags):
        raise SpecError("%s: flags and gear must be whole numbers." % path)
    return Command(float(throttle), float(steer), float(brake), *flags)


_KINDS: Dict[str, Type[DriverSpec]] = {
    "route": RouteDriverSpec,
    "class": ClassDriverSpec,
    "replay": ReplayDriverSpec,
    **dict.fromkeys(DEVICES, DeviceDriverSpec),
}


def read_driver(section: Fields) -> DriverSpec:
    """Check and read the section by its kind."""
    return _KINDS[section.text("kind", tuple(_KINDS))].read(section)
