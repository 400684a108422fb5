"""How driving lanes follow each other, found by place and direction.

A lane is cut into runs at the ends of its road and of its sections; OpenDRIVE files often have
roads of a metre or two before junctions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.columns import Rotation

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


class LaneGraph:
    """The runs of all driving lanes, and which follow which.

    Args:
        lanes: samples of all driving lanes.
    """

    def __init__(self, lanes: LaneSamples) -> None:
        self._lanes = lanes
        # Lanes with negative numbers run along the road, the others against it.
        self._along_m = np.where(lanes.lane_id > 0, -lanes.s_m, lanes.s_m)
        keys = (self._along_m, lanes.lane_id, lanes.section_id, lanes.road_id)
        order = np.lexsort(keys)
        lane = np.stack([lanes.road_id, lanes.section_id, lanes.lane_id])[:, order]
        begins = np.flatnonzero(np.r_[True, (lane[:, 1:] != lane[:, :-1]).any(axis=0)])
        self._runs = np.split(order, begins[1:])
        self._run_of_sample = np.empty(len(order), np.int64)
        for number, run in enumerate(self._runs):
            self._run_of_sample[run] = number
        self._first = np.array([run[0] for run in self._runs])
        self._last = np.array([run[-1] for run in self._runs])

    def _joined(self, sample: int, ends: NDArray[np.int64]) -> list[int]:
        """Runs of which the given end lies at a sample, in the same direction; nearest first."""
        lanes = self._lanes
        apart_m = np.linalg.norm(lanes.location[ends] - lanes.location[sample], axis=1)
        turn = lanes.rotation_deg[ends, Rotation.YAW] - lanes.rotation_deg[sample, Rotation.YAW]
        same_way = np.abs((turn + 180.0) % 360.0 - 180.0) < _SAME_WAY_DEG
        joined = np.flatnonzero((apart_m < _SAME_PLACE_M) & same_way)
        found: list[int] = joined[np.argsort(apart_m[joined], kind="stable")].tolist()
        return found

    def before(
        self, sample: int, reach_m: float, beyond_m: float = 0.0
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Samples outside junctions from which a lane leads to one of its samples.

        Args:
            sample: row of the lane samples, outside junctions.
            reach_m: how far upstream.
            beyond_m: how far downstream they are listed too, with negative distances.

        Returns:
            ``(S,)`` rows and ``(S,)`` metres before the sample.
        """
        found: dict[int, float] = {}
        self._walk(sample, 0.0, reach_m, upstream=True, found=found)
        down: dict[int, float] = {}
        self._walk(sample, 0.0, beyond_m, upstream=False, found=down)
        for row, metres in down.items():
            found.setdefault(row, -metres)
        return np.array(list(found), np.int64), np.array(list(found.values()), np.float64)

    def _walk(
        self,
        sample: int,
        walked_m: float,
        reach_m: float,
        *,
        upstream: bool,
        found: dict[int, float],
    ) -> None:
        """Notes how far away the samples along the lane are, up to a distance."""
        run = self._runs[self._run_of_sample[sample]]
        sign = 1.0 if upstream else -1.0
        metres = walked_m + sign * (self._along_m[sample] - self._along_m[run])
        inside = (metres >= walked_m) & (metres <= reach_m)
        for row, distance_m in zip(run[inside].tolist(), metres[inside].tolist(), strict=True):
            found[row] = min(distance_m, found.get(row, np.inf))
        end = int(run[0] if upstream else run[-1])
        if not inside[0 if upstream else -1]:
            return
        for number in self._joined(end, self._last if upstream else self._first):
            following = int(self._last[number] if upstream else self._first[number])
            if self._lanes.junction_id[following] < 0 and following not in found:
                gap_m = float(
                    np.linalg.norm(self._lanes.location[following] - self._lanes.location[end])
                )
                self._walk(following, found[end] + gap_m, reach_m, upstream=upstream, found=found)

    def ways(self, sample: int) -> list[NDArray[np.int64]]:
        """What follows a lane's end inside the junction there: rows of samples, in their order.

        Args:
            sample: the last row of a lane that leads into a junction.

        Returns:
            Of each way, its samples up to where it leaves the junction or forks.
        """
        found: list[NDArray[np.int64]] = []
        for number in self._joined(sample, self._first):
            if self._lanes.junction_id[self._first[number]] < 0:
                continue
            way, following = [self._runs[number]], self._inside_after(number)
            while len(following) == 1 and all(self._runs[following[0]] is not run for run in way):
                way.append(self._runs[following[0]])
                following = self._inside_after(following[0])
            found.append(np.concatenate(way))
        return found

    def _inside_after(self, number: int) -> list[int]:
        """Runs of the same junction that follow one."""
        junctions = self._lanes.junction_id[self._first]
        following = self._joined(int(self._last[number]), self._first)
        return [n for n in following if n != number and junctions[n] == junctions[number] >= 0]

    def junction_entries(self) -> JunctionEntries:
        """Where lanes lead into junctions."""
        lanes = self._lanes
        starts = self._first[lanes.junction_id[self._first] >= 0]
        samples: list[int] = []
        junctions: list[int] = []
        arms: list[int] = []
        known: dict[int, dict[tuple[int, bool], int]] = {}
        for end in self._last[lanes.junction_id[self._last] < 0].tolist():
            joined = self._joined(end, starts)
            if not joined:
                continue
            junction_id = int(lanes.junction_id[starts[joined[0]]])
            roads = known.setdefault(junction_id, {})
            road = (int(lanes.road_id[end]), bool(lanes.lane_id[end] > 0))
            samples.append(end)
            junctions.append(junction_id)
            arms.append(roads.setdefault(road, len(roads)))
        return JunctionEntries(
            np.array(samples, np.int64), np.array(junctions, np.int32), np.array(arms, np.int32)
        )
