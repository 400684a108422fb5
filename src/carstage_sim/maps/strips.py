"""Lane samples as strips: one record per lane of a road section and level, with its two edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.signals import Signal
from carstage_sim.maps.town import LaneSamples

Samples = Mapping[str, NDArray[np.generic]]
"""The columns that ``carstage_sim.maps.opendrive.sample`` describes."""

UNPOSTED_LIMIT_KMH = 30.0
"""Before the first sign, as in CARLA."""
_SIGN_REACH_M = 3.0
"""A vehicle of 200 km/h is within this of a sign at one of twenty frames a second."""

LANE_KINDS = (
    "driving", "shoulder", "sidewalk", "parking", "biking", "border", "median", "none", "stop",
    "restricted", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "bus",
    "taxi", "HOV", "curb", "walking", "special1", "special2", "special3", "roadWorks", "tram",
    "rail", "mwyEntry", "mwyExit",
)  # fmt: skip
"""Lane types that are sampled, OpenDRIVE 1.4 to 1.7; the index is the code in the arrays."""
WALKED_KINDS = frozenset({"sidewalk", "walking"})
MEDIAN_KINDS = frozenset({"median"})
MARK_KINDS = (
    "NONE", "Solid", "Broken", "SolidSolid", "SolidBroken", "BrokenSolid", "BrokenBroken", "Curb",
)  # fmt: skip
"""The client's names of lines that are drawn; the index is the code in the arrays."""
OTHER_WAY_ROUND = {"SolidBroken": "BrokenSolid", "BrokenSolid": "SolidBroken"}
_NARROWEST_M = 0.02
"""Lanes that are nowhere wider do not exist but in the file."""
_SHORTEST_M = 0.01
_SMALLEST_CROSSWALK_M2 = 0.5
_OF_NO_LANE = ("crosswalk", "crosswalk_number", "record")
_USUAL_LINE_M = 0.15
"""Of lines whose width the file leaves out."""


@dataclass(frozen=True, slots=True)
class LaneMark:
    """A line along a lane's edge; ``kind`` is one of ``MARK_KINDS``."""

    kind: str
    yellow: bool
    width_m: float


@dataclass(frozen=True, slots=True)
class Strip:
    """A lane of one road section, sampled along its direction of travel.

    Attributes:
        kind: one of ``LANE_KINDS``.
        road_id, section_id, lane_id, junction_id: OpenDRIVE's; junction -1 outside junctions.
        level: 0 on the ground, more where it crosses above other lanes.
        center: ``(N, 2)`` m, CARLA's frame.
        z_m: ``(N,)``.
        yaw_deg: ``(N,)`` direction of travel.
        width_m: ``(N,)``.
        station: ``(N,)`` numbers of the cross-sections.
        inner, outer: the lines towards the road's middle and away from it, of each of the N - 1
            pieces between cross-sections.
    """

    kind: str
    road_id: int
    section_id: int
    lane_id: int
    junction_id: int
    level: int
    center: NDArray[np.float64]
    z_m: NDArray[np.float64]
    yaw_deg: NDArray[np.float64]
    width_m: NDArray[np.float64]
    station: NDArray[np.int64]
    inner: tuple[LaneMark, ...]
    outer: tuple[LaneMark, ...]

    def offset(self, right: float) -> NDArray[np.float64]:
        """The line ``right`` half widths beside the centre; 1 is the right edge, -1 the left."""
        yaw = np.radians(self.yaw_deg)
        normal = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
        line: NDArray[np.float64] = self.center + normal * (0.5 * right * self.width_m)[:, None]
        return line

    @property
    def along_m(self) -> NDArray[np.float64]:
        """``(N,)`` distance along the centre."""
        steps = np.linalg.norm(np.diff(self.center, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def polygon(self) -> BaseGeometry:
        """The lane's surface."""
        left, right = self.offset(-1.0), self.offset(1.0)
        whole = shapely.Polygon(np.concatenate([left, right[::-1]]))
        if whole.is_valid:
            return whole
        # A lane that bends within its own width: its edges cross, its pieces are sound.
        corners = np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)
        quads = np.asarray(shapely.multipoints(np.asarray(shapely.points(corners))))
        pieces = np.asarray(shapely.convex_hull(quads))
        return shapely.union_all(pieces[shapely.area(pieces) > 0.0])


def strips(samples: Samples, level: NDArray[np.int64]) -> list[Strip]:
    """The strips of all sampled lanes, in the samples' order, cut where the level changes.

    Args:
        samples: the lane samples.
        level: by station, of the piece of road between it and the next.
    """
    names = ("road_id", "section_id", "lane_id")
    keys = np.stack([samples[k] for k in names], axis=1).astype(np.int64)
    breaks = np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1)) + 1
    station = np.asarray(samples["station"], dtype=np.int64)
    location = np.asarray(samples["location"], dtype=np.float64)
    yaw = np.asarray(samples["rotation_deg"], dtype=np.float64)[:, 1]
    width = np.asarray(samples["width_m"], dtype=np.float64)
    mark_width = np.asarray(samples["mark_width_m"], dtype=np.float64)
    kind, junction = samples["lane_kind"], samples["junction_id"]
    inner, outer = samples["inner_mark"], samples["outer_mark"]
    result = []
    for lane in np.split(np.arange(len(keys)), breaks):
        if len(lane) < 2 or width[lane].max() < _NARROWEST_M:
            continue
        changes = np.flatnonzero(np.diff(level[station[lane[:-1]]])) + 1
        for piece in np.split(np.arange(len(lane) - 1), changes):
            rows = lane[piece[0] : piece[-1] + 2]
            # Along the lane, not from end to end: a loop ends where it begins.
            steps = np.abs(np.diff(location[rows], axis=0))
            if steps.sum(axis=0).max(initial=0.0) < _SHORTEST_M:
                continue
            road_id, section_id, lane_id = (int(v) for v in keys[rows[0]])
            # Samples ascend in s; travel on positive lanes descends.
            travel = rows[::-1] if lane_id > 0 else rows
            # A line holds for growing s, so that of a piece stands at the end with the smaller one.
            begun = travel[1:] if lane_id > 0 else travel[:-1]
            result.append(
                Strip(
                    kind=LANE_KINDS[int(kind[rows[0]])],
                    road_id=road_id,
                    section_id=section_id,
                    lane_id=lane_id,
                    junction_id=int(junction[rows[0]]),
                    level=int(level[station[rows[0]]]),
                    center=location[travel, :2],
                    z_m=location[travel, 2],
                    yaw_deg=yaw[travel],
                    width_m=width[travel],
                    station=station[travel],
                    inner=_marks(inner[begun], mark_width[begun, 0]),
                    outer=_marks(outer[begun], mark_width[begun, 1]),
                )
            )
    return result


def _marks(
    kind_and_colour: NDArray[np.generic], width_m: NDArray[np.float64]
) -> tuple[LaneMark, ...]:
    """Rows of ``inner_mark`` or ``outer_mark`` as lines."""
    rows = zip(kind_and_colour.tolist(), width_m.tolist(), strict=True)
    return tuple(
        LaneMark(MARK_KINDS[kind], bool(yellow), paint_m or _USUAL_LINE_M)
        for (kind, yellow), paint_m in rows
    )


def driving_lanes(samples: Samples, signs: Sequence[Signal]) -> LaneSamples:
    """The rows of the driving lanes.

    Args:
        samples: the map's.
        signs: of speed limits; those without a number say nothing. As in CARLA the limit of a
            vehicle is that of the last sign that it passed, and 30 km/h before the first, whatever
            limits the roads of the file have (``WheeledVehicleAIController.h``,
            ``SpeedLimitComponent.cpp``). Not as in CARLA, a vehicle that appears on a road with
            signs for its direction has passed the nearest.
    """
    rows = np.flatnonzero(samples["lane_kind"] == LANE_KINDS.index("driving"))
    column = {key: np.asarray(samples[key])[rows] for key in samples if key not in _OF_NO_LANE}
    limit = np.full(len(rows), UNPOSTED_LIMIT_KMH, np.float32)
    posted = np.zeros(len(rows), np.float32)
    nearest_m = np.full(len(rows), np.inf)
    is_left = column["lane_id"].astype(np.int32) > 0
    for sign in signs:
        for lane in sign.lanes if sign.value > 0.0 else ():
            same_road = column["road_id"] == lane.road_id
            same_way = same_road & (is_left == (lane.lane_id > 0))
            apart_m = np.linalg.norm(column["location"] - np.array(lane.stop), axis=1)
            nearer = same_way & (apart_m < nearest_m)
            limit[nearer], nearest_m[nearer] = sign.value, apart_m[nearer]
            passed = same_way & (column["lane_id"] == lane.lane_id) & (apart_m <= _SIGN_REACH_M)
            posted[passed] = sign.value
    return LaneSamples(
        location=column["location"].astype(np.float64),
        rotation_deg=column["rotation_deg"].astype(np.float64),
        width_m=column["width_m"].astype(np.float32),
        speed_limit_kmh=limit,
        posted_kmh=posted,
        road_id=column["road_id"].astype(np.int32),
        section_id=column["section_id"].astype(np.int32),
        lane_id=column["lane_id"].astype(np.int32),
        s_m=column["s_m"].astype(np.float64),
        junction_id=column["junction_id"].astype(np.int32),
    )


@dataclass(frozen=True, slots=True)
class Crosswalk:
    """A crossing on the road: its outline and the height of its middle."""

    area: shapely.Polygon
    z_m: float


def crosswalks(samples: Samples) -> list[Crosswalk]:
    """Crosswalks whose outline is an area."""
    corners = np.asarray(samples["crosswalk"], dtype=np.float64)
    begins = np.flatnonzero(np.diff(np.asarray(samples["crosswalk_number"], np.int64))) + 1
    result: list[Crosswalk] = []
    for ring in np.split(corners, begins):
        area = shapely.Polygon(ring[:, :2]) if len(ring) > 2 else shapely.Polygon()
        if area.is_valid and area.area > _SMALLEST_CROSSWALK_M2:
            result.append(Crosswalk(area, float(ring[:, 2].mean())))
    return result
