"""What a vector map is made of: lanes, markings, junctions, crosswalks, stop lines, signals, paint.

Places are metres in CARLA's frame (docs/conventions.md). Polylines run in the direction of travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

from carstage.geometry import FloatArray

DRIVEN_TYPES: Final = (
    "driving", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp",
)  # fmt: skip
"""Types of lanes that traffic drives on."""
WALKED_TYPES: Final = ("sidewalk", "walking")
LIGHT_TYPE: Final = "1000001"
"""A signal's type: CARLA's traffic lights, whatever the country."""
STOP_SIGN_TYPE: Final = "206"


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """What may be driven from a station on.

    Attributes:
        s_m: station on the road where it begins.
        limit_m_s: the limit; None: there is none.
    """

    s_m: float
    limit_m_s: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """A lane of one lane section.

    Attributes:
        id: ``road/section/lane``; sections count from 0 along the road.
        road_id, section, lane: the same, as numbers; lanes count from the middle of the road,
            negative on the right of its reference line.
        junction_id: the junction that the road is part of.
        type: OpenDRIVE's, such as ``driving``, ``sidewalk``, ``shoulder``, ``parking``.
        direction: ``forward`` along the road's reference line, ``backward``, or ``both``; of
            lanes nobody drives on, that of the lanes beside them.
        centre_line, left_boundary, right_boundary: ``(N, 3)``, of the same stations.
        s_m: ``(N,)`` stations on the road's reference line.
        width_m: ``(N,)`` at them.
        predecessors, successors: ids of lanes that lead here, and that this one leads to.
        left_neighbour, right_neighbour: ids of the lanes beside it, also of opposite traffic.
        left_markings, right_markings: ids of what is painted on its boundaries.
        speed_limits: along the road; empty where the map says nothing.
    """

    id: str
    road_id: int
    section: int
    lane: int
    junction_id: int | None
    type: str
    direction: str
    centre_line: FloatArray
    left_boundary: FloatArray
    right_boundary: FloatArray
    s_m: FloatArray
    width_m: FloatArray
    predecessors: tuple[str, ...] = ()
    successors: tuple[str, ...] = ()
    left_neighbour: str | None = None
    right_neighbour: str | None = None
    left_markings: tuple[str, ...] = ()
    right_markings: tuple[str, ...] = ()
    speed_limits: tuple[SpeedLimit, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Marking:
    """A stretch of one kind of marking on the boundary between two lanes.

    Attributes:
        id: ``road/section/lane/number`` of the lane on whose outer boundary it is; lane 0 is the
            middle of the road.
        road_id, section, lane: the same, as numbers.
        line: ``(N, 3)`` along the road's reference line.
        s_m: ``(2,)`` stations where it begins and ends.
        type: OpenDRIVE's: ``solid``, ``broken``, ``curb``, …; of ``solid broken`` the first word is
            the stroke nearer to the road's middle, of lane 0 the one at the left of the road.
        colour: ``white``, ``yellow``, ``blue``, ``green``, ``red`` or ``other``.
        width_m: 0 where the map says nothing.
        lane_change: who may cross it: ``none``, ``increase`` and ``decrease`` (of the lane's
            number), ``both``.
        lanes: ids of the lanes beside it.
    """

    id: str
    road_id: int
    section: int
    lane: int
    line: FloatArray
    s_m: FloatArray
    type: str
    colour: str
    width_m: float
    lane_change: str
    lanes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Junction:
    """Where roads meet.

    Attributes:
        junction_id: OpenDRIVE's number of it.
        outline: ``(N, 3)`` closed convex hull of its lanes; None where it has none.
        roads: numbers of the roads through it.
        signal_controllers: ids of the controllers that it names.
    """

    junction_id: int
    name: str
    outline: FloatArray | None
    roads: tuple[int, ...]
    signal_controllers: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Crosswalk:
    """A pedestrian crossing; ``outline`` is closed, ``(N, 3)``."""

    id: str
    road_id: int
    name: str
    outline: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class StopLine:
    """Where vehicles stop.

    Attributes:
        line: ``(N, 3)``, across the lanes.
        lanes: ids of the lanes that it ends.
        signals: ids of the signals for which it is.
        source: ``object``: the map has it; ``signal``: it follows from where a light or a stop
            sign applies.
    """

    id: str
    road_id: int
    line: FloatArray
    lanes: tuple[str, ...]
    signals: tuple[str, ...]
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class PaintedObject:
    """Something painted on the road that the map has as an object.

    Attributes:
        id: OpenDRIVE's.
        name: as the map has it.
        type: ``arrow``, ``text``, ``line`` or ``region``.
        subtype: of an arrow its ways, such as ``left straight``; of a text what the map calls it;
            of a line ``solid`` or ``broken``; of a region such as ``chevron``. Empty: not known.
        colour: ``white`` or ``yellow``.
        outline: ``(N, 3)``, closed; of an arrow or a text the rectangle around it.
        lanes: ids of the lanes that it lies on.
    """

    id: str
    road_id: int
    name: str
    type: str
    subtype: str
    colour: str
    outline: FloatArray
    lanes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """A traffic light or a sign.

    Attributes:
        id: OpenDRIVE's; a landmark of CARLA's client has the same.
        place: ``(3,)``.
        type, subtype, country: by the list of signs of that country; CARLA's lights are 1000001.
        value, unit: such as a speed limit.
        dynamic: whether it changes, as lights do.
        lanes: ids of the lanes that it is for.
        controllers: ids of the controllers that switch it.
    """

    id: str
    road_id: int
    name: str
    place: FloatArray
    type: str
    subtype: str
    country: str
    value: float | None
    unit: str
    dynamic: bool
    lanes: tuple[str, ...]
    controllers: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class VectorMap:
    """A town as lines and areas."""

    lanes: tuple[Lane, ...] = ()
    markings: tuple[Marking, ...] = ()
    junctions: tuple[Junction, ...] = ()
    crosswalks: tuple[Crosswalk, ...] = ()
    stop_lines: tuple[StopLine, ...] = ()
    signals: tuple[Signal, ...] = ()
    painted_objects: tuple[PaintedObject, ...] = ()

    @cached_property
    def lane_by_id(self) -> dict[str, Lane]:
        """Lanes by their ids."""
        return {lane.id: lane for lane in self.lanes}

    @cached_property
    def marking_by_id(self) -> dict[str, Marking]:
        """Markings by their ids."""
        return {marking.id: marking for marking in self.markings}
