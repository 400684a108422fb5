"""Where driving lanes lead into junctions, and which of them come along one road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples

_SAME_PLACE_M = 2.0
_SAME_WAY_DEG = 30.0


@dataclass(frozen=True, slots=True)
class JunctionEntries:
    """The last samples of all lanes that lead into a junction.

    Attributes:
        sample: ``(E,)`` int64 rows of the lane samples.
        junction_id: ``(E,)`` int32, where each lane leads.
        arm: ``(E,)`` int32, equal for lanes of one road that lead there side by side; counted from
            0 in each junction.
    """

    sample: NDArray[np.int64]
    junction_id: NDArray[np.int32]
    arm: NDArray[np.int32]


def junction_entries(lanes: LaneSamples) -> JunctionEntries:
    """Finds them by place and direction.

    Args:
        lanes: samples of all driving lanes.
    """
    first, last = _ends(lanes)
    starts = first[lanes.junction_id[first] >= 0]
    ends = last[lanes.junction_id[last] < 0]
    samples: list[int] = []
    junctions: list[int] = []
    arms: list[int] = []
    known: dict[int, dict[tuple[int, bool], int]] = {}
    for end in ends.tolist():
        apart_m = np.linalg.norm(lanes.location[starts] - lanes.location[end], axis=1)
        turn = lanes.rotation_deg[starts, 1] - lanes.rotation_deg[end, 1]
        same_way = np.abs((turn + 180.0) % 360.0 - 180.0) < _SAME_WAY_DEG
        apart_m[~same_way] = np.inf
        if not len(apart_m) or apart_m.min() > _SAME_PLACE_M:
            continue
        junction_id = int(lanes.junction_id[starts[apart_m.argmin()]])
        roads = known.setdefault(junction_id, {})
        road = (int(lanes.road_id[end]), bool(lanes.lane_id[end] > 0))
        samples.append(end)
        junctions.append(junction_id)
        arms.append(roads.setdefault(road, len(roads)))
    return JunctionEntries(
        np.array(samples, np.int64), np.array(junctions, np.int32), np.array(arms, np.int32)
    )


def _ends(lanes: LaneSamples) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last sample of each lane of each section, in the direction of travel."""
    # Lanes with negative numbers run along the road, the others against it.
    along_m = np.where(lanes.lane_id > 0, -lanes.s_m, lanes.s_m)
    order = np.lexsort((along_m, lanes.lane_id, lanes.section_id, lanes.road_id))
    lane = np.stack([lanes.road_id, lanes.section_id, lanes.lane_id])[:, order]
    begins = np.flatnonzero(np.r_[True, (lane[:, 1:] != lane[:, :-1]).any(axis=0)])
    return order[begins], order[np.r_[begins[1:], len(order)] - 1]
