"""The records of a road network in OpenDRIVE's frame and terms: roads, lanes, junctions, lights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from carstage_sim.maps.alignment import Alignment, Pose2
from carstage_sim.maps.plan import Point

Contact = Literal["start", "end"]


class LaneKind(Enum):
    """OpenDRIVE lane types in use."""

    DRIVING = "driving"
    SHOULDER = "shoulder"
    SIDEWALK = "sidewalk"


@dataclass(frozen=True, slots=True)
class RoadMark:
    """A lane's outer line (or the centre line)."""

    kind: str
    color: str = "white"
    width_m: float = 0.15
    lane_change: str = "none"


@dataclass(frozen=True, slots=True)
class Lane:
    """One lane of a road; ids grow outwards, negative to the right of the reference line."""

    lane_id: int
    kind: LaneKind
    width_m: float
    mark: RoadMark | None = None
    predecessor: int | None = None
    successor: int | None = None


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road joins at one end."""

    element: Literal["road", "junction"]
    element_id: int
    contact: Contact | None = None


@dataclass(frozen=True, slots=True)
class Road:
    """A road with one lane section, or one lane-to-lane path through a junction."""

    road_id: int
    alignment: Alignment
    lanes: tuple[Lane, ...]
    center_mark: RoadMark | None
    speed_limit_kmh: int
    junction_id: int
    predecessor: RoadLink
    successor: RoadLink


@dataclass(frozen=True, slots=True)
class Connection:
    """A way through a junction: from a road, along a connecting road, lane by lane."""

    incoming_road: int
    connecting_road: int
    lane_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Arm:
    """Where a street meets a junction.

    Attributes:
        road_id, contact: the street's road and which of its ends is here.
        mouth: on the centre line where the junction begins, heading into the junction.
        lanes: driving lanes per direction.
        lane_width_m, kerb_m, sidewalk_width_m: cross-section.
    """

    road_id: int
    contact: Contact
    mouth: Pose2
    lanes: int
    lane_width_m: float
    kerb_m: float
    sidewalk_width_m: float

    def lane_id(self, index: int, *, inbound: bool) -> int:
        """OpenDRIVE id of the ``index``-th driving lane from the centre line, counted from 1."""
        return -index if inbound == (self.contact == "end") else index

    @property
    def outward_heading_rad(self) -> float:
        """Heading of traffic that leaves the junction here."""
        return self.mouth.heading_rad + math.pi


@dataclass(frozen=True, slots=True)
class Light:
    """A traffic light: what it governs and where it stands.

    Attributes:
        signal_id, controller_id: OpenDRIVE ids.
        phase: place of its controller in the junction's cycle.
        arm: the approach that it governs.
        pole: foot of the pole; the heading is the way that the lenses look.
        reach_m: length of the arm that carries the head, towards the governed lanes.
        host_road, host_s_m, host_t_m: the road that carries the signal element.
        host_heading_rad: heading of that road there.
    """

    signal_id: str
    controller_id: str
    phase: int
    arm: Arm
    pole: Pose2
    reach_m: float
    host_road: int
    host_s_m: float
    host_t_m: float
    host_heading_rad: float


@dataclass(frozen=True, slots=True)
class Junction:
    """A crossing of three or four arms."""

    junction_id: int
    center: Point
    arms: tuple[Arm, ...]
    connections: tuple[Connection, ...]
    lights: tuple[Light, ...]


@dataclass(frozen=True, slots=True)
class SpeedSign:
    """A posted limit beside a road, for the traffic of some of its lanes.

    Attributes:
        signal_id: OpenDRIVE id.
        road_id, s_m, t_m: where.
        lanes: lowest and highest lane id that it holds for.
        limit_kmh: what it says.
        post: foot of the post; the heading is the way that the plate looks.
    """

    signal_id: str
    road_id: int
    s_m: float
    t_m: float
    lanes: tuple[int, int]
    limit_kmh: int
    post: Pose2


@dataclass(frozen=True, slots=True)
class RoadNetwork:
    """Everything that the OpenDRIVE file of a planned town says."""

    name: str
    latitude_deg: float
    longitude_deg: float
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...]
    speed_signs: tuple[SpeedSign, ...]
