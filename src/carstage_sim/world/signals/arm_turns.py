"""Junctions without lights: where vehicles come from several arms, the arms take turns.

CARLA tells the controllers of vehicles at stop and yield signs "red", without a light, while others
are on the junction (``StopSignComponent.cpp``, ``YieldSignComponent.cpp``). A vehicle that the
Traffic Manager drives then stops and joins the queue of that junction, from which one at a time
enters in the order of their coming (``TrafficLightStage.cpp``; wheel 0.9.13 spaces them by time).
Without that, one that turns left, one that comes towards it and one from the side can each stand in
the way of the next. CARLA's own towns have those signs in their levels, not in their OpenDRIVE
files, so here every junction of three arms or more that has no lights gets turns; the entries of
roundabouts and merges have two. Junctions with an arm too short to wait on get none: who waited
there would stand on the junction behind.

Only vehicles that can still stop wait; none does while all come from one arm. Nobody sets off
while somebody comes from another arm too fast to stop. So most who come at 30 km/h pass, and find
their ways past each other; to stop them all would jam large junctions. But where turns run past
each other closer than vehicles are wide, two of the Traffic Manager's stand for ever. There they
stop on the junction's first metres, too, which nobody from another arm touches.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.signals.lane_graph import LaneGraph

FloatArray = NDArray[np.float64]

NEAR_M = 20.0
"""A vehicle counts when its middle is nearer to the junction than this,"""
SOON_S = 4.0
"""or will be there so soon."""
_FARTHEST_M = 100.0
TURN_S = 8.0
"""So long an arm goes while others wait."""
CLEAR_S = 6.0
"""So long the next arm waits at most for the junction to be empty."""
_FEWEST_ARMS = 3
_ROOM_M = 20.0
"""Every arm has at least so much room to wait, which is three vehicles."""
_LOOK_AHEAD_M = 5.5
"""Nearer than this the Traffic Manager's look-ahead of 6 m is on the junction."""
_OVER_LINE_M = 1.5
"""Who has its bumper farther on the junction than this goes on;"""
_FARTHEST_OVER_LINE_M = 6.0
"""where turns are tight, at most this."""
_TIGHT_M = 2.2
"""Ways that run past each other are nearer than this where vehicles cannot pass."""
_APART_M = 3.0
"""Nearer to a way of another arm than this, a vehicle stands in it; ways that end so near merge."""
_BRAKES = 6.0
"""m/s²; who would need more to stop, within the Traffic Manager's look-ahead, goes on."""


class _Turns:
    """Whose turn it is at one junction.

    Args:
        first: the first of the junction's arms, which are next to each other in all of the map's.
        count: how many it has.

    Attributes:
        arms: the junction's arms.
        active: which of them goes, counted from 0.
        is_closing: whether nobody may enter until the junction is empty.
    """

    def __init__(self, first: int, count: int) -> None:
        self.arms = slice(first, first + count)
        self.active = 0
        self.is_closing = False
        self._elapsed_s = 0.0
        self._waited_s = [0.0] * count

    def step(self, delta_s: float, counts: list[int], *, is_empty: bool) -> None:
        """Goes on by a tick.

        Args:
            delta_s: of the tick.
            counts: vehicles before each arm.
            is_empty: whether nobody is on the junction.
        """
        self._waited_s = [
            waited_s + delta_s if count else 0.0
            for waited_s, count in zip(self._waited_s, counts, strict=True)
        ]
        self._elapsed_s += delta_s
        own = counts[self.active]
        if not self.is_closing and sum(counts) > own and (not own or self._elapsed_s > TURN_S):
            self.is_closing, self._elapsed_s = True, 0.0
        if self.is_closing and (is_empty or self._elapsed_s > CLEAR_S):
            self._waited_s[self.active] = 0.0
            self.active = max(range(len(counts)), key=self._waited_s.__getitem__)
            self.is_closing, self._elapsed_s = False, 0.0

    def may_enter(self) -> list[bool]:
        """Of each arm, whether who comes from it may enter."""
        return [not self.is_closing and arm == self.active for arm in range(len(self._waited_s))]


class ArmTurns:
    """Turns at all junctions of a map that have no lights.

    Args:
        lanes: samples of all driving lanes.
        lit: ids of the junctions that have lights.
    """

    def __init__(self, lanes: LaneSamples, lit: Collection[int]) -> None:
        graph = LaneGraph(lanes)
        entries = graph.junction_entries()
        self._arm_of_sample = np.full(len(lanes.s_m), -1, np.intp)
        self._before_m = np.zeros(len(lanes.s_m))
        self._over_line_m = np.full(len(lanes.s_m), _OVER_LINE_M)
        self._turns_of_sample = np.full(len(lanes.s_m), -1, np.intp)
        self._turns: list[_Turns] = []
        count = 0
        for junction_id in sorted(set(entries.junction_id.tolist()) - set(lit)):
            here = np.flatnonzero(entries.junction_id == junction_id)
            arms = int(entries.arm[here].max()) + 1
            before = [graph.before(int(entries.sample[entry]), _FARTHEST_M) for entry in here]
            if arms < _FEWEST_ARMS or min(metres.max() for _, metres in before) < _ROOM_M:
                continue
            ways = [graph.ways(int(entries.sample[entry])) for entry in here]
            lines = [[lanes.location[way, :2] for way in found] for found in ways]
            over_line_m = _over_line_m(lines, entries.arm[here].tolist())
            for entry, (samples, before_m), over_m in zip(
                here.tolist(), before, over_line_m, strict=True
            ):
                self._arm_of_sample[samples] = count + entries.arm[entry]
                self._before_m[samples] = before_m
                self._over_line_m[samples] = over_m
            self._turns_of_sample[lanes.junction_id == junction_id] = len(self._turns)
            self._turns.append(_Turns(count, arms))
            count += arms
        self._arm_count = count
        self._seen: NDArray[np.uint32] = np.zeros(0, np.uint32)
        self.waiting_ids: NDArray[np.uint32] = np.zeros(0, np.uint32)
        """Ids of the vehicles that have to wait."""

    def step(
        self,
        delta_s: float,
        ids: NDArray[np.uint32],
        samples: NDArray[np.int32],
        speed: NDArray[np.float64],
        half_length: NDArray[np.float64],
    ) -> None:
        """Goes on by a tick.

        Args:
            delta_s: of the tick.
            ids: ``(N,)`` of the vehicles that are on lanes.
            samples: ``(N,)`` nearest lane sample of each.
            speed: ``(N,)`` m/s.
            half_length: ``(N,)`` metres.
        """
        if not self._turns:
            return
        arm, on = self._arm_of_sample[samples], self._turns_of_sample[samples]
        reach_m = np.maximum(SOON_S * np.abs(speed), NEAR_M)
        rows = np.flatnonzero((arm >= 0) & (self._before_m[samples] < reach_m))
        arm = arm[rows]
        # How far the bumper may still go, from here and from where a look-ahead begins.
        beyond_m = self._over_line_m[samples[rows]] - half_length[rows]
        nose_m = self._before_m[samples[rows]] + beyond_m
        rushes = speed[rows] ** 2 > 2.0 * _BRAKES * np.maximum(_LOOK_AHEAD_M + beyond_m, 0.0)
        is_rushed = np.bincount(arm[rushes], minlength=self._arm_count) > 0
        counts = np.bincount(arm, minlength=self._arm_count)
        occupants = np.bincount(on[on >= 0], minlength=len(self._turns))
        goes = np.ones(self._arm_count, np.bool_)
        is_contested = np.zeros(self._arm_count, np.bool_)
        for turns, inside in zip(self._turns, occupants.tolist(), strict=True):
            before = counts[turns.arms].tolist()
            turns.step(delta_s, before, is_empty=not inside)
            rushed = is_rushed[turns.arms]
            goes[turns.arms] = rushed if rushed.any() else turns.may_enter()
            is_contested[turns.arms] = sum(map(bool, before)) > 1
        stops = (nose_m > 0.0) & (speed[rows] ** 2 <= 2.0 * _BRAKES * nose_m)
        looks = self._before_m[samples[rows]] <= _LOOK_AHEAD_M
        # Told to wait in one frame, a vehicle joins the Traffic Manager's queue. Did those whose
        # turn it is not join, those of the other arms would be the first in it meanwhile.
        joins = looks & ~np.isin(ids[rows], self._seen) & is_contested[arm]
        self._seen = ids[rows[looks]]
        self.waiting_ids = ids[rows[stops & (~goes[arm] | joins)]]


def _over_line_m(ways: Sequence[Sequence[FloatArray]], arms: Sequence[int]) -> list[float]:
    """How far onto a junction those of each lane may come who wait.

    Args:
        ways: ``(S, 2)`` places of each way of each lane.
        arms: which arm each lane belongs to.
    """
    by_arm = [(arm, way) for arm, own in zip(arms, ways, strict=True) for way in own]
    pairs = [(a, b) for n, (arm, a) in enumerate(by_arm) for other, b in by_arm[:n] if other != arm]
    if not any(_is_tight(a, b) for a, b in pairs):
        return [_OVER_LINE_M] * len(ways)
    found = []
    for own, arm in zip(ways, arms, strict=True):
        others = shapely.MultiPoint(np.concatenate([b for other, b in by_arm if other != arm]))
        free_m = min((_metres_apart(way, others) for way in own), default=_OVER_LINE_M)
        found.append(min(max(free_m, _OVER_LINE_M), _FARTHEST_OVER_LINE_M))
    return found


def _is_tight(one: FloatArray, other: FloatArray) -> bool:
    """Whether two ways run past each other, and vehicles on them cannot."""
    a, b = shapely.LineString(one), shapely.LineString(other)
    merge = np.linalg.norm(one[-1] - other[-1]) < _APART_M
    return bool(not merge and a.distance(b) < _TIGHT_M and not a.intersects(b))


def _metres_apart(way: FloatArray, others: shapely.MultiPoint) -> float:
    """How far along a way a vehicle stands in none of the others."""
    near = np.flatnonzero(shapely.distance(shapely.points(way), others) < _APART_M)
    steps_m = np.linalg.norm(np.diff(way, axis=0), axis=1)
    return float(steps_m[: near[0]].sum()) if len(near) else np.inf
