"""Lane samples as strips: one record per lane of a road section, with its two edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples

Samples = Mapping[str, NDArray[np.generic]]
"""The columns that ``carstage_sim.maps.opendrive.sample`` describes."""

DEFAULT_LIMIT_KMH = 30.0
"""Where a file gives no speed limit: zero would stop the client's Traffic Manager."""

LANE_KINDS = ("driving", "shoulder", "sidewalk", "parking", "biking", "border", "median")
"""Lane types that are sampled; the index is the code in the arrays."""
MARK_KINDS = ("NONE", "Solid", "Broken", "SolidSolid", "SolidBroken", "BrokenSolid", "Curb")


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
        center: ``(N, 2)`` m, CARLA's frame.
        yaw_deg: ``(N,)`` direction of travel.
        width_m: ``(N,)``.
        inner, outer: the lines towards the road's middle and away from it.
    """

    kind: str
    road_id: int
    section_id: int
    lane_id: int
    junction_id: int
    center: NDArray[np.float64]
    yaw_deg: NDArray[np.float64]
    width_m: NDArray[np.float64]
    inner: LaneMark
    outer: LaneMark

    def offset(self, right: float) -> NDArray[np.float64]:
        """The line ``right`` half widths beside the centre; 1 is the right edge, -1 the left."""
        yaw = np.radians(self.yaw_deg)
        normal = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
        line: NDArray[np.float64] = self.center + normal * (0.5 * right * self.width_m)[:, None]
        return line

    @property
    def polygon(self) -> shapely.Polygon:
        """The lane's surface."""
        return shapely.Polygon(np.concatenate([self.offset(-1.0), self.offset(1.0)[::-1]]))


def strips(samples: Samples) -> list[Strip]:
    """The strips of all sampled lanes, in the samples' order."""
    keys = np.stack([samples[k] for k in ("road_id", "section_id", "lane_id")], axis=1)
    breaks = np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1)) + 1
    result = []
    for rows in np.split(np.arange(len(keys)), breaks):
        if len(rows) < 2:
            continue
        road_id, section_id, lane_id = (int(v) for v in keys[rows[0]])
        # Samples ascend in s; travel on positive lanes descends.
        travel = rows[::-1] if lane_id > 0 else rows
        middle = rows[len(rows) // 2]
        widths = np.asarray(samples["mark_width_m"], dtype=np.float64)[middle]
        marks = [
            LaneMark(
                MARK_KINDS[int(samples[side][middle, 0])],
                bool(samples[side][middle, 1]),
                float(width) or 0.15,
            )
            for side, width in zip(("inner_mark", "outer_mark"), widths, strict=True)
        ]
        result.append(
            Strip(
                LANE_KINDS[int(samples["lane_kind"][middle])],
                road_id,
                section_id,
                lane_id,
                int(samples["junction_id"][middle]),
                np.asarray(samples["location"], dtype=np.float64)[travel, :2],
                np.asarray(samples["rotation_deg"], dtype=np.float64)[travel, 1],
                np.asarray(samples["width_m"], dtype=np.float64)[travel],
                marks[0],
                marks[1],
            )
        )
    return result


def driving_lanes(samples: Samples) -> LaneSamples:
    """The rows of the driving lanes."""
    rows = np.flatnonzero(samples["lane_kind"] == LANE_KINDS.index("driving"))
    column = {key: np.asarray(samples[key])[rows] for key in samples if key != "crosswalk"}
    posted = column["speed_limit_kmh"].astype(np.float64)
    limit = np.where(posted > 0.0, posted, DEFAULT_LIMIT_KMH)
    return LaneSamples(
        location=column["location"].astype(np.float64),
        rotation_deg=column["rotation_deg"].astype(np.float64),
        width_m=column["width_m"].astype(np.float32),
        speed_limit_kmh=limit.astype(np.float32),
        road_id=column["road_id"].astype(np.int32),
        section_id=column["section_id"].astype(np.int32),
        lane_id=column["lane_id"].astype(np.int32),
        s_m=column["s_m"].astype(np.float64),
        junction_id=column["junction_id"].astype(np.int32),
    )


def crosswalks(samples: Samples) -> list[shapely.Polygon]:
    """Crosswalk polygons: the flat list of corners is split where an outline closes."""
    corners = np.asarray(samples["crosswalk"], dtype=np.float64)[:, :2]
    result: list[shapely.Polygon] = []
    begin = 0
    for i in range(1, len(corners)):
        if i > begin + 2 and np.allclose(corners[i], corners[begin], atol=1e-3):
            result.append(shapely.Polygon(corners[begin : i + 1]))
            begin = i + 1
    return result
