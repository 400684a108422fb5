"""Events that happen to the ego in an episode: what is asked for, one class for each kind."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Dict, Iterable, List, Optional, Tuple, Type, TypeVar

from carstage.sensor_kinds import InstalledModules
from carstage.spec.fields import Fields
from carstage.spec.values import Value

ENTRY_POINT_GROUP = "carstage.events"
"""Group of entry points; each names a module that registers kinds of events."""
LONGEST_S = 86_400.0
SIDES = ("right", "left")
MANNERS = ("pass", "follow")
EXTENTS = ("narrow", "close")


def quantity(
    default: float, low: float, high: float, *, unit: Optional[str] = None, sentence: str = ""
) -> Any:
    """A number of an event, with the values that it may have.

    Args:
        default: its value where none is given.
        low: the lowest; both limits may be given.
        high: the highest.
        unit: of the number, such as ``m/s``; for kinds of other packages, as is ``sentence``.
        sentence: what it means; the configuration's form shows it.
    """
    words = {"low": low, "high": high, "unit": unit, "sentence": sentence}
    return field(default=default, metadata=words)


def word(default: str, known: Tuple[str, ...], *, sentence: str = "") -> Any:
    """A word of an event, one of those that are known.

    Args:
        default: its value where none is given.
        known: all values that it may have.
        sentence: what it means; for kinds of other packages.
    """
    return field(default=default, metadata={"known": known, "sentence": sentence})


def flag(default: bool, *, sentence: str = "") -> Any:
    """A yes or no of an event; ``sentence`` as for the others."""
    return field(default=default, metadata={"sentence": sentence})


def named(kind: str) -> Any:
    """The field that holds the name of a kind."""
    return field(default=kind, init=False)


EventClass = TypeVar("EventClass", bound="EventSpec")


@dataclass(frozen=True, eq=False, repr=False)
class EventSpec(Value):
    """One event.

    Attributes:
        kind: its name.
        at_s: seconds after the first recorded step; a place is looked for from then on.
        nearest_counts: distances are those to the nearest of who takes part, else to the first.
        sets_lights: it sets traffic lights, which may skip a state then.
        collector: class that makes it happen, as ``module:Class``; for kinds of other packages.
    """

    nearest_counts: ClassVar[bool] = False
    sets_lights: ClassVar[bool] = False
    collector: ClassVar[str] = ""

    kind: str = named("")
    at_s: float = quantity(0.0, 0.0, LONGEST_S)

    @classmethod
    def read(cls: Type[EventClass], section: Fields) -> EventClass:
        """Check and read the section of this kind."""
        given: Dict[str, Any] = {}
        for each in fields(cls):
            if not each.init:
                continue
            if "known" in each.metadata:
                given[each.name] = section.text(each.name, each.metadata["known"])
            elif isinstance(each.default, bool):
                given[each.name] = section.flag(each.name)
            else:
                low, high = each.metadata["low"], each.metadata["high"]
                given[each.name] = section.number(each.name, least=low, most=high)
        return cls(**given)

    def parameters(self) -> Dict[str, Any]:
        """All but the kind, by name."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.init}


@dataclass(frozen=True, eq=False, repr=False)
class PedestrianCrosses(EventSpec):
    """A pedestrian waits at the kerb ahead and crosses before the ego.

    Attributes:
        distance_m: from the ego to where it crosses, when it is placed.
        trigger_m: it steps out when the ego is that near.
        speed_m_s: how fast it walks.
        side: of the road, as the ego sees it, from which it comes.
        parked_car: it steps out from behind a car at the kerb.
    """

    kind: str = named("pedestrian_crosses")
    distance_m: float = quantity(35.0, 10.0, 150.0)
    trigger_m: float = quantity(20.0, 3.0, 150.0)
    speed_m_s: float = quantity(1.6, 0.3, 5.0)
    side: str = word("right", SIDES)
    parked_car: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class HardBrakingLeader(EventSpec):
    """A car drives ahead of the ego and brakes to a stop.

    Attributes:
        gap_m: from the ego's front to its rear, as it leads.
        lead_s: how long it leads before it brakes.
        deceleration_m_s2: how hard it brakes.
        stand_s: how long it stands; then it drives on.
    """

    kind: str = named("hard_braking_leader")
    gap_m: float = quantity(12.0, 5.0, 60.0)
    lead_s: float = quantity(2.0, 0.0, 30.0)
    deceleration_m_s2: float = quantity(6.0, 1.0, 10.0)
    stand_s: float = quantity(3.0, 0.0, 300.0)


@dataclass(frozen=True, eq=False, repr=False)
class CutIn(EventSpec):
    """A car beside the ego's lane moves over, closely ahead, and drives slower.

    Attributes:
        gap_m: from the ego's front to its rear, as it begins to move over.
        change_s: how long it takes to move over.
        slower_m_s: how much slower than the ego it drives then.
    """

    kind: str = named("cut_in")
    gap_m: float = quantity(8.0, 2.0, 60.0)
    change_s: float = quantity(2.5, 1.0, 8.0)
    slower_m_s: float = quantity(2.0, 0.0, 15.0)


@dataclass(frozen=True, eq=False, repr=False)
class StoppedVehicle(EventSpec):
    """A car stands in the ego's lane with its hazard lights on, then drives on.

    Attributes:
        distance_m: from the ego to it, when it is placed.
        trigger_m: the event begins when the ego is that near.
        stand_s: how long it stands from then on.
    """

    kind: str = named("stopped_vehicle")
    distance_m: float = quantity(50.0, 15.0, 200.0)
    trigger_m: float = quantity(25.0, 8.0, 200.0)
    stand_s: float = quantity(5.0, 0.0, 300.0)


@dataclass(frozen=True, eq=False, repr=False)
class OncomingOvertaker(EventSpec):
    """A car that comes towards the ego passes another one in the ego's lane.

    Attributes:
        distance_m: from the ego to it, as it begins to swing out.
        speed_m_s: how fast it passes.
        slower_m_s: how much slower the other car drives.
        change_s: how long it takes to move over, and how long to move back.
    """

    kind: str = named("oncoming_overtaker")
    distance_m: float = quantity(70.0, 20.0, 200.0)
    speed_m_s: float = quantity(13.0, 3.0, 30.0)
    slower_m_s: float = quantity(10.0, 2.0, 25.0)
    change_s: float = quantity(1.2, 0.5, 5.0)


@dataclass(frozen=True, eq=False, repr=False)
class EmergencyVehicle(EventSpec):
    """An emergency vehicle comes from behind with flashing lamps, and passes or follows the ego.

    Attributes:
        distance_m: from its front to the ego's rear, as it appears.
        faster_m_s: than the ego, as it comes nearer and passes.
        manner: it passes, or it follows.
        gap_m: from its front to the ego's rear, as it follows.
        follow_s: how long it follows.
    """

    kind: str = named("emergency_vehicle")
    distance_m: float = quantity(15.0, 5.0, 100.0)
    faster_m_s: float = quantity(9.0, 1.0, 20.0)
    manner: str = word("pass", MANNERS)
    gap_m: float = quantity(6.0, 2.0, 50.0)
    follow_s: float = quantity(5.0, 0.0, 60.0)


@dataclass(frozen=True, eq=False, repr=False)
class WrongWayCyclist(EventSpec):
    """A cyclist rides against the traffic, near the kerb of the ego's lane.

    Attributes:
        distance_m: from the ego to the cyclist, when it is placed.
        trigger_m: the event begins when the ego is that near.
        speed_m_s: how fast it rides.
        kerb_m: from the right edge of the lane to the middle of the bicycle.
    """

    kind: str = named("wrong_way_cyclist")
    distance_m: float = quantity(50.0, 10.0, 200.0)
    trigger_m: float = quantity(30.0, 5.0, 200.0)
    speed_m_s: float = quantity(4.0, 1.0, 12.0)
    kerb_m: float = quantity(0.1, 0.0, 1.5)


@dataclass(frozen=True, eq=False, repr=False)
class RedLightRunner(EventSpec):
    """A car crosses the ego's junction against red, while the ego has green.

    Attributes:
        trigger_m: from the ego to the junction, when the car appears.
        speed_m_s: how fast it drives.
        before_s: so much earlier than the ego it comes to where their ways cross; negative: later.
    """

    sets_lights = True

    kind: str = named("red_light_runner")
    trigger_m: float = quantity(25.0, 10.0, 80.0)
    speed_m_s: float = quantity(11.0, 4.0, 25.0)
    before_s: float = quantity(1.0, -3.0, 5.0)


@dataclass(frozen=True, eq=False, repr=False)
class WorksZone(EventSpec):
    """Cones, a barrier and a sign narrow or close the ego's lane.

    Attributes:
        distance_m: from the ego to the first cone, when they are placed.
        trigger_m: the event begins when the ego is that near to the barrier.
        length_m: of the part behind the barrier.
        extent: they narrow the lane, or they close it.
        width_m: how much of the lane they take from its right edge; of no use where they close it.
        speed_m_s: how fast the ego passes them at most.
    """

    nearest_counts = True

    kind: str = named("works_zone")
    distance_m: float = quantity(35.0, 15.0, 150.0)
    trigger_m: float = quantity(25.0, 10.0, 200.0)
    length_m: float = quantity(10.0, 2.0, 60.0)
    extent: str = word("narrow", EXTENTS)
    width_m: float = quantity(0.8, 0.2, 1.2)
    speed_m_s: float = quantity(6.0, 2.0, 15.0)


EVENT_SPECS: Dict[str, Type[EventSpec]] = {
    cls().kind: cls
    for cls in (
        PedestrianCrosses,
        HardBrakingLeader,
        CutIn,
        StoppedVehicle,
        OncomingOvertaker,
        EmergencyVehicle,
        WrongWayCyclist,
        RedLightRunner,
        WorksZone,
    )
}
"""The classes by kind: those of Car-STAGE, then those that other packages register."""

_installed = InstalledModules(ENTRY_POINT_GROUP)


def register_event(cls: Type[EventClass]) -> Type[EventClass]:
    """Class decorator that adds a kind of event of another package.

    It must be registered before ``carstage.config`` is imported: by an entry point of the group
    ``carstage.events`` it always is. The class is a frozen dataclass with a docstring; its module
    needs the standard library only, and Python 3.8, as the collector imports it.

    Raises:
        ValueError: the kind is taken, its name is none, or no ``collector`` is named.
    """
    kind = cls().kind
    taken = EVENT_SPECS.get(kind)
    if taken is not None and taken.__module__ != cls.__module__:
        raise ValueError("event %r is registered already" % kind)
    if not kind.isidentifier() or kind != kind.lower():
        raise ValueError("event %r: use small letters, digits and '_'" % kind)
    if ":" not in cls.collector:
        raise ValueError("event %r: name its collector as module:Class" % kind)
    EVENT_SPECS[kind] = cls
    return cls


def known_events() -> Dict[str, Type[EventSpec]]:
    """The classes by kind, those of installed packages too."""
    _installed.load()
    return EVENT_SPECS


def event_plugins(events: Optional[Iterable[EventSpec]]) -> List[str]:
    """Modules that a collector imports so that it knows these events."""
    return sorted({type(event).__module__ for event in events or () if event.collector})


def read_events(sections: Iterable[Fields]) -> Optional[Tuple[EventSpec, ...]]:
    """Check and read the events of a scenario; None where there are none."""
    found: List[EventSpec] = []
    for event in sections:
        known = EVENT_SPECS if event.text("kind") in EVENT_SPECS else known_events()
        found.append(known[event.text("kind", tuple(known))].read(event))
    return tuple(found) or None
