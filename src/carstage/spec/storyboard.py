"""A storyboard: who is there, and what they do when. OpenSCENARIO 1.x files are read into it.

Words (rules, edges, states, shapes) are OpenSCENARIO's own. Places and angles are in CARLA's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping, Optional, Tuple, Union

from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

RULES = ("lessThan", "lessOrEqual", "equalTo", "notEqualTo", "greaterOrEqual", "greaterThan")
EDGES = ("none", "rising", "falling", "risingOrFalling")
SHAPES = ("linear", "step", "sinusoidal", "cubic")
DIMENSIONS = ("time", "rate", "distance")
PRIORITIES = ("override", "skip", "parallel")
ELEMENT_TYPES = ("act", "maneuverGroup", "maneuver", "event", "action")
STATES = ("standbyState", "runningState", "completeState")
TRANSITIONS = ("startTransition", "endTransition", "stopTransition", "skipTransition")
EUCLIDEAN, LONGITUDINAL, LATERAL = "euclidean", "longitudinal", "lateral"
MEASURES = (EUCLIDEAN, LONGITUDINAL, LATERAL)
MOST_LANES = 1000
LONGEST_DELAY_S = 3600.0
CONDITIONS = (
    "time",
    "element",
    "traveled",
    "reach",
    "distance",
    "relative_distance",
    "speed",
    "relative_speed",
    "stand_still",
    "time_to_collision",
    "headway",
)


@dataclass(frozen=True, eq=False, repr=False)
class WorldPlace(Value):
    """A place in the world.

    Attributes:
        z_m: which of several lanes above each other it is on, and its height where there is none.
            None: on a lane at any height.
    """

    kind: str = field(default="world", init=False)
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: Optional[float] = field(default=None, metadata=LEFT_OUT)
    yaw_deg: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class LanePlace(Value):
    """A place of a lane.

    Attributes:
        right_m: so far to the right of its middle.
        yaw_deg: from the lane's direction of travel.
    """

    kind: str = field(default="lane", init=False)
    road: int = 0
    lane: int = 0
    s_m: float = 0.0
    right_m: float = 0.0
    yaw_deg: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class RelativeLanePlace(Value):
    """A place along the road from where somebody is.

    Attributes:
        entity: who.
        lanes: to be added to the number of its lane.
        ahead_m: so far on along the lane.
        right_m: so far to the right of the lane's middle.
        yaw_deg: from the lane's direction of travel.
    """

    kind: str = field(default="relative_lane", init=False)
    entity: str = ""
    lanes: int = 0
    ahead_m: float = 0.0
    right_m: float = 0.0
    yaw_deg: float = 0.0


StoryPlace = Union[WorldPlace, LanePlace, RelativeLanePlace]


def _read_place(section: Fields) -> StoryPlace:
    kind = section.text("kind", ("world", "lane", "relative_lane"))
    yaw_deg = section.number("yaw_deg")
    if kind == "world":
        z_m = section.number("z_m") if "z_m" in section else None
        return WorldPlace(section.number("x_m"), section.number("y_m"), z_m, yaw_deg)
    right_m = section.number("right_m")
    if kind == "lane":
        road = section.integer("road", 0)
        lane = section.integer("lane", -MOST_LANES, MOST_LANES)
        return LanePlace(road, lane, section.number("s_m", least=0.0), right_m, yaw_deg)
    lanes = section.integer("lanes", -MOST_LANES, MOST_LANES)
    ahead_m = section.number("ahead_m")
    return RelativeLanePlace(section.text("entity"), lanes, ahead_m, right_m, yaw_deg)


@dataclass(frozen=True, eq=False, repr=False)
class StoryEntity(Value):
    """Somebody or something that is there from the begin on.

    Attributes:
        name: in the file.
        blueprint: CARLA's.
        attributes: of the blueprint.
        place: where it begins.
        speed_m_s: how fast.
    """

    name: str
    blueprint: str
    attributes: Mapping[str, str]
    place: StoryPlace
    speed_m_s: float

    @classmethod
    def read(cls, section: Fields) -> StoryEntity:
        """Check and read one."""
        return cls(
            section.text("name"),
            section.text("blueprint"),
            section.object("attributes").texts(),
            _read_place(section.object("place")),
            section.number("speed_m_s", least=0.0),
        )


@dataclass(frozen=True, eq=False, repr=False)
class StoryDynamics(Value):
    """How something goes from one value to another.

    Attributes:
        shape: one of ``SHAPES``.
        dimension: what ``value`` is: s, m/s² or m/s, m.
    """

    shape: str
    dimension: str
    value: float

    @classmethod
    def read(cls, section: Fields) -> StoryDynamics:
        """Check and read one."""
        return cls(
            section.text("shape", SHAPES),
            section.text("dimension", DIMENSIONS),
            section.number("value", least=0.0),
        )


@dataclass(frozen=True, eq=False, repr=False)
class StorySpeed(Value):
    """A change of speed.

    Attributes:
        target: m/s; of another's speed, what is added to it or multiplies it.
        other: whose speed; None: ``target`` is the speed itself.
        is_factor: ``target`` multiplies.
    """

    kind: str = field(default="speed", init=False)
    name: str = ""
    dynamics: StoryDynamics = StoryDynamics("step", "time", 0.0)
    target: float = 0.0
    other: Optional[str] = field(default=None, metadata=LEFT_OUT)
    is_factor: bool = field(default=False, metadata=LEFT_OUT)


@dataclass(frozen=True, eq=False, repr=False)
class StoryLaneChange(Value):
    """A change of lane.

    Attributes:
        lane: number of the lane; None: ``left`` counts.
        left: so many lanes to the left.
    """

    kind: str = field(default="lane_change", init=False)
    name: str = ""
    dynamics: StoryDynamics = StoryDynamics("step", "time", 0.0)
    lane: Optional[int] = field(default=None, metadata=LEFT_OUT)
    left: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class StoryTeleport(Value):
    """A jump to another place."""

    kind: str = field(default="teleport", init=False)
    name: str = ""
    place: StoryPlace = WorldPlace()


StoryAction = Union[StorySpeed, StoryLaneChange, StoryTeleport]


def _read_action(section: Fields) -> StoryAction:
    kind, name = section.text("kind", ("speed", "lane_change", "teleport")), section.text("name")
    if kind == "teleport":
        return StoryTeleport(name, _read_place(section.object("place")))
    dynamics = StoryDynamics.read(section.object("dynamics"))
    if kind == "lane_change":
        lane = section.integer("lane", -MOST_LANES, MOST_LANES) if "lane" in section else None
        return StoryLaneChange(
            name, dynamics, lane, section.integer("left", -MOST_LANES, MOST_LANES)
        )
    return StorySpeed(
        name,
        dynamics,
        section.number("target"),
        section.text("other") if "other" in section else None,
        section.flag("is_factor") if "is_factor" in section else False,
    )


@dataclass(frozen=True, eq=False, repr=False)
class StoryCondition(Value):
    """What has to hold.

    Attributes:
        kind: one of ``CONDITIONS``.
        edge: one of ``EDGES``.
        delay_s: so long ago it held.
        rule: how what is measured compares with ``value``.
        value: s, m or m/s.
        entities: whose measure counts.
        every: all of them have to fulfil it; else one of them.
        other: from whom is measured.
        place: from where is measured.
        measure: one of ``MEASURES``.
        freespace: distances are those between boxes.
        element: type and name of a part of the storyboard.
        state: of that part: one of ``STATES`` or ``TRANSITIONS``.
    """

    kind: str
    edge: str
    delay_s: float
    rule: str = "greaterThan"
    value: float = 0.0
    entities: Tuple[str, ...] = ()
    every: bool = False
    other: Optional[str] = field(default=None, metadata=LEFT_OUT)
    place: Optional[StoryPlace] = field(default=None, metadata=LEFT_OUT)
    measure: str = EUCLIDEAN
    freespace: bool = False
    element: Optional[Tuple[str, str]] = field(default=None, metadata=LEFT_OUT)
    state: Optional[str] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, section: Fields) -> StoryCondition:
        """Check and read one."""
        element = section.words("element")
        if element and (len(element) != 2 or element[0] not in ELEMENT_TYPES):
            raise SpecError("%s: must be a type and a name." % section.path("element"))
        return cls(
            section.text("kind", CONDITIONS),
            section.text("edge", EDGES),
            section.number("delay_s", least=0.0, most=LONGEST_DELAY_S),
            section.text("rule", RULES),
            section.number("value"),
            section.words("entities"),
            section.flag("every"),
            section.text("other") if "other" in section else None,
            _read_place(section.object("place")) if "place" in section else None,
            section.text("measure", MEASURES),
            section.flag("freespace"),
            (element[0], element[1]) if element else None,
            section.text("state", STATES + TRANSITIONS) if "state" in section else None,
        )


Trigger = Tuple[Tuple[StoryCondition, ...], ...]
"""Holds when all conditions of one of its groups do."""


def read_trigger(section: Fields, name: str) -> Trigger:
    """Check and read the groups of conditions of a field."""
    groups = []
    for index, group in enumerate(section.list(name)):
        place = "[%d]" % index
        conditions = Fields({place: group}, section.path(name)).objects(place)
        groups.append(tuple(map(StoryCondition.read, conditions)))
    return tuple(groups)


@dataclass(frozen=True, eq=False, repr=False)
class StoryEvent(Value):
    """Actions that begin together.

    Attributes:
        priority: what becomes of others of its maneuver.
        most: so often it may happen.
        start: when; None: as soon as its act runs.
    """

    name: str
    priority: str
    most: int
    actions: Tuple[StoryAction, ...]
    start: Optional[Trigger]

    @classmethod
    def read(cls, section: Fields) -> StoryEvent:
        """Check and read one."""
        return cls(
            section.text("name"),
            section.text("priority", PRIORITIES),
            section.integer("most", 1),
            tuple(map(_read_action, section.objects("actions"))),
            read_trigger(section, "start") if "start" in section else None,
        )


@dataclass(frozen=True, eq=False, repr=False)
class StoryManeuver(Value):
    """Events one after the other, or beside each other."""

    name: str
    events: Tuple[StoryEvent, ...]

    @classmethod
    def read(cls, section: Fields) -> StoryManeuver:
        """Check and read one."""
        return cls(section.text("name"), tuple(map(StoryEvent.read, section.objects("events"))))


@dataclass(frozen=True, eq=False, repr=False)
class StoryGroup(Value):
    """Who carries out maneuvers."""

    name: str
    actors: Tuple[str, ...]
    maneuvers: Tuple[StoryManeuver, ...]

    @classmethod
    def read(cls, section: Fields) -> StoryGroup:
        """Check and read one."""
        maneuvers = tuple(map(StoryManeuver.read, section.objects("maneuvers")))
        return cls(section.text("name"), section.words("actors"), maneuvers)


@dataclass(frozen=True, eq=False, repr=False)
class StoryAct(Value):
    """Groups that act from one trigger to another.

    Attributes:
        start: when; None: at once.
    """

    name: str
    groups: Tuple[StoryGroup, ...]
    start: Optional[Trigger]
    stop: Trigger

    @classmethod
    def read(cls, section: Fields) -> StoryAct:
        """Check and read one."""
        return cls(
            section.text("name"),
            tuple(map(StoryGroup.read, section.objects("groups"))),
            read_trigger(section, "start") if "start" in section else None,
            read_trigger(section, "stop"),
        )
