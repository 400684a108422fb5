"""The records of a road network in OpenDRIVE's frame and terms."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from carstage_sim.maps.writer.alignment import Alignment, length_m
from carstage_sim.maps.writer.cubic import Cubic
from carstage_sim.maps.writer.elevation import LEVEL, Profile

Contact = Literal["start", "end"]


class LaneKind(Enum):
    """OpenDRIVE lane types in use."""

    DRIVING = "driving"
    BIKING = "biking"
    PARKING = "parking"
    SHOULDER = "shoulder"
    SIDEWALK = "sidewalk"
    MEDIAN = "median"


@dataclass(frozen=True, slots=True)
class RoadMark:
    """A lane's outer line (or the centre line)."""

    kind: str
    color: str = "white"
    width_m: float = 0.15
    lane_change: str = "none"


@dataclass(frozen=True, slots=True)
class Lane:
    """One lane of a section; ids grow outwards, negative to the right of the reference line.

    Attributes:
        lane_id, kind: OpenDRIVE's.
        width: in metres, from the section's start on.
        mark: the line at the outer edge.
        predecessor, successor: ids of the lanes that it joins at the section's start and end.
    """

    lane_id: int
    kind: LaneKind
    width: tuple[Cubic, ...]
    mark: RoadMark | None = None
    predecessor: int | None = None
    successor: int | None = None


@dataclass(frozen=True, slots=True)
class LaneSection:
    """The lanes from ``start_m`` on, from left to right."""

    start_m: float
    lanes: tuple[Lane, ...]


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road joins at one end."""

    element: Literal["road", "junction"]
    element_id: int
    contact: Contact | None = None


@dataclass(frozen=True, slots=True)
class Signal:
    """A traffic light or a sign, at the road beside which it stands.

    Attributes:
        signal_id: OpenDRIVE id.
        name: for people.
        s_m, t_m: where.
        turn_rad: from the road's heading to the way that the face looks.
        orientation: the traffic that it is for, ``+`` along the road, ``-`` against it.
        lanes: lowest and highest lane id that it governs here.
        type_code, subtype, value: of the catalogue.
        is_light: whether it changes.
        unit: of the value.
        text: what it says.
        size_m: edge of the plate.
    """

    signal_id: str
    name: str
    s_m: float
    t_m: float
    turn_rad: float
    orientation: str
    lanes: tuple[int, int]
    type_code: str
    subtype: str = "-1"
    value: str = "-1"
    is_light: bool = False
    unit: str | None = None
    text: str = ""
    size_m: float = 0.0


@dataclass(frozen=True, slots=True)
class SignalReference:
    """Where a signal that stands elsewhere takes effect: a stop line and its lanes."""

    signal_id: str
    s_m: float
    t_m: float
    orientation: str
    lanes: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Crosswalk:
    """A crosswalk straight over a road, around the station ``s_m``."""

    object_id: str
    s_m: float
    width_m: float
    length_m: float


@dataclass(frozen=True, slots=True)
class Road:
    """A road, or one path through a junction.

    Attributes:
        road_id: OpenDRIVE id.
        kind: OpenDRIVE road type, such as ``town`` or ``motorway``.
        alignment: the reference line.
        heights: along it.
        sections: ascending.
        center_mark: the line along the reference line.
        speed_limit_kmh: of all its lanes.
        junction_id: -1 outside junctions.
        predecessor, successor: what it joins.
        signals, references, crosswalks: what stands along it.
    """

    road_id: int
    alignment: Alignment
    sections: tuple[LaneSection, ...]
    center_mark: RoadMark | None
    speed_limit_kmh: int
    junction_id: int
    predecessor: RoadLink
    successor: RoadLink
    kind: str = "town"
    heights: Profile = LEVEL
    signals: tuple[Signal, ...] = ()
    references: tuple[SignalReference, ...] = ()
    crosswalks: tuple[Crosswalk, ...] = ()

    @property
    def length_m(self) -> float:
        """Length of the reference line."""
        return length_m(self.alignment)


@dataclass(frozen=True, slots=True)
class Connection:
    """A way through a junction: from a road, along a connecting road, lane by lane."""

    incoming_road: int
    connecting_road: int
    lane_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Controller:
    """Lights that are green together, and their place in the junction's cycle."""

    controller_id: str
    phase: int
    signal_id: str


@dataclass(frozen=True, slots=True)
class Junction:
    """The ways between some roads, and the controllers of their lights."""

    junction_id: int
    connections: tuple[Connection, ...]
    controllers: tuple[Controller, ...] = ()


@dataclass(frozen=True, slots=True)
class RoadNetwork:
    """Everything that the OpenDRIVE file of a planned town says."""

    name: str
    latitude_deg: float
    longitude_deg: float
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...]
