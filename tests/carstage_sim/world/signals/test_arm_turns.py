"""Junctions without lights: the arms take turns, and only who can stop is told to wait."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.signals.arm_turns import CLEAR_S, TURN_S, ArmTurns
from carstage_sim.world.signals.lane_graph import LaneGraph

_TICK_S = 0.05
_HALF_LENGTH_M = 2.3
_LANE_M = 60
_JUNCTION = 7
_HEADINGS_DEG = (0.0, 90.0, 180.0, 270.0)


Parts = dict[str, list[np.ndarray]]


def _no_parts() -> Parts:
    return {name: [] for name in LaneSamples.__slots__}


def _add_lane(
    parts: Parts, road: int, junction: int, places: np.ndarray, yaw_deg: float | np.ndarray
) -> None:
    """One lane through places (N, 3), a metre apart; within a junction where it is not -1."""
    count = len(places)
    rotation_deg = np.zeros((count, 3))
    rotation_deg[:, 1] = yaw_deg
    parts["location"].append(places)
    parts["rotation_deg"].append(rotation_deg)
    parts["width_m"].append(np.full(count, 3.5, np.float32))
    parts["speed_limit_kmh"].append(np.full(count, 30.0, np.float32))
    parts["posted_kmh"].append(np.zeros(count, np.float32))
    parts["road_id"].append(np.full(count, road + (10 if junction >= 0 else 0), np.int32))
    parts["section_id"].append(np.zeros(count, np.int32))
    parts["lane_id"].append(np.full(count, -1, np.int32))
    parts["s_m"].append(np.arange(count, dtype=np.float64))
    parts["junction_id"].append(np.full(count, junction, np.int32))


def _joined(parts: Parts) -> LaneSamples:
    return LaneSamples(**{name: np.concatenate(columns) for name, columns in parts.items()})


def crossing(arms: int, shortest_m: int = _LANE_M) -> LaneSamples:
    """Lanes of 60 m towards the origin, and ways of 10 m that go straight on from each.

    The first lane may be shorter.
    """
    parts = _no_parts()
    for road, heading_deg in enumerate(_HEADINGS_DEG[:arms]):
        along = np.array([np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg)), 0.0])
        length_m = _LANE_M if road else shortest_m
        for junction, first_m, last_m in ((-1, -length_m - 5, -5), (_JUNCTION, -5, 5)):
            s_m = np.arange(last_m - first_m + 1, dtype=np.float64)
            _add_lane(parts, road, junction, (first_m + s_m)[:, None] * along, heading_deg)
    return _joined(parts)


def passing(apart_m: float) -> LaneSamples:
    """Lanes of 60 m and their ways through a junction of 30 m.

    One goes straight on, one comes from the other side, bends towards it until they are so far
    apart, and away again; the third crosses.
    """
    ends = [[(-15, 0), (15, 0)], [(0, -15), (0, 15)], [(15, apart_m + 6), (0, apart_m), (-15, 9)]]
    parts = _no_parts()
    for road, (heading_deg, corners) in enumerate(zip(_HEADINGS_DEG, ends, strict=False)):
        along = np.array([np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))])
        lane = np.array(corners[0]) + np.arange(-_LANE_M, 1)[:, None] * along
        way = np.array(shapely.LineString(corners).segmentize(1.0).coords)
        for junction, places in ((-1, lane), (_JUNCTION, way)):
            steps = np.diff(places, axis=0, append=2 * places[-1:] - places[-2:-1])
            yaw_deg = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
            at = np.column_stack([places, np.zeros(len(places))])
            _add_lane(parts, road, junction, at, yaw_deg)
    return _joined(parts)


class Scene:
    """Vehicles that stand where a test puts them."""

    def __init__(
        self,
        arms: int = 3,
        lit: tuple[int, ...] = (),
        shortest_m: int = _LANE_M,
        lanes: LaneSamples | None = None,
    ) -> None:
        self.lanes = crossing(arms, shortest_m) if lanes is None else lanes
        self.turns = ArmTurns(self.lanes, lit)

    def sample(self, arm: int, before_m: float) -> int:
        """The sample of an arm's lane so far before its end; behind it when negative."""
        road = arm if before_m >= 0 else arm + 10
        s_m = _LANE_M - before_m if before_m >= 0 else -before_m
        return int(np.flatnonzero((self.lanes.road_id == road) & (self.lanes.s_m == s_m))[0])

    def told(
        self,
        *places: tuple[int, float],
        seconds: float = _TICK_S,
        speed: float | tuple[float, ...] = 0.0,
    ) -> list[bool]:
        """Who is told to wait after some time, of vehicles at (arm, metres before its end)."""
        samples = np.array([self.sample(*place) for place in places], np.int32)
        count = len(places)
        for _ in range(round(seconds / _TICK_S)):
            self.turns.step(
                _TICK_S,
                np.arange(1, count + 1, dtype=np.uint32),
                samples,
                np.broadcast_to(np.array(speed, np.float64), count),
                np.full(count, _HALF_LENGTH_M),
            )
        return np.isin(np.arange(1, count + 1), self.turns.waiting_ids).tolist()


def test_every_lane_that_leads_into_a_junction_is_an_entry_and_roads_are_arms() -> None:
    lanes = crossing(4)
    entries = LaneGraph(lanes).junction_entries()
    assert lanes.road_id[entries.sample].tolist() == [0, 1, 2, 3]
    assert (lanes.s_m[entries.sample] == _LANE_M).all()
    assert entries.junction_id.tolist() == [_JUNCTION] * 4
    assert entries.arm.tolist() == [0, 1, 2, 3]


def test_who_comes_alone_never_waits() -> None:
    for arm in range(3):
        scene = Scene()
        for before_m in (20.0, 8.0, 5.0, 3.0, -2.0, -8.0):
            assert scene.told((arm, before_m), seconds=1.0) == [False]


def test_of_vehicles_from_several_arms_those_of_one_go() -> None:
    told = Scene().told((0, 4.0), (1, 4.0), (2, 4.0), seconds=1.0)
    assert sum(told) == 2


def test_nobody_enters_while_somebody_of_another_arm_is_on_the_junction() -> None:
    scene = Scene()
    assert scene.told((0, 4.0), (1, 4.0), seconds=1.0) == [False, True]
    assert scene.told((0, -3.0), (1, 4.0), seconds=CLEAR_S - 1.0) == [False, True]
    assert scene.told((0, -11.0 + 1.0), (1, 4.0), seconds=3.0)[1] is False


def test_a_junction_that_stays_occupied_is_entered_after_a_while() -> None:
    scene = Scene()
    scene.told((0, 4.0), (1, 4.0), seconds=1.0)
    assert scene.told((0, -3.0), (1, 4.0), seconds=CLEAR_S + 2.0) == [False, False]


def test_a_junction_with_an_arm_too_short_to_wait_on_has_no_turns() -> None:
    waiting = ((1, 4.0), (2, 4.0))
    assert sum(Scene(shortest_m=25).told(*waiting, seconds=1.0)) == 1
    assert Scene(shortest_m=15).told(*waiting, seconds=1.0) == [False, False]


def test_an_arm_gives_way_after_its_turn_although_more_come() -> None:
    scene = Scene()
    assert scene.told((0, 4.0), (1, 4.0), seconds=1.0) == [False, True]
    assert scene.told((0, 4.0), (1, 4.0), seconds=TURN_S) == [True, False]


def test_the_arm_that_waited_longest_is_next() -> None:
    scene = Scene()
    scene.told((0, 4.0), seconds=1.0)
    scene.told((0, 4.0), (2, 4.0), seconds=1.0)
    told = scene.told((0, 4.0), (2, 4.0), (1, 4.0), seconds=TURN_S)
    assert told == [True, False, True]


def test_whose_turn_it_is_joins_the_queue_in_one_frame() -> None:
    scene = Scene()
    scene.told((0, 8.0), (1, 8.0), seconds=1.0)
    assert scene.told((0, 5.0), (1, 8.0)) == [True, True]
    assert scene.told((0, 5.0), (1, 8.0)) == [False, True]


@pytest.mark.parametrize(
    ("before_m", "speed", "waits"),
    [(8.0, 7.0, True), (8.0, 12.0, False), (2.0, 0.0, True), (0.0, 0.0, False)],
)
def test_only_who_can_stop_before_the_junction_waits(
    before_m: float, speed: float, waits: bool
) -> None:
    scene = Scene()
    scene.told((0, 4.0), (1, 15.0), seconds=1.0)
    assert scene.told((0, 4.0), (1, before_m), seconds=0.1, speed=(0.0, speed))[1] is waits


@pytest.mark.parametrize(("apart_m", "waits"), [(1.5, True), (4.0, False)])
def test_where_turns_are_tight_who_comes_at_30_kmh_stops_on_the_junction(
    apart_m: float, waits: bool
) -> None:
    scene = Scene(lanes=passing(apart_m))
    scene.told((0, 4.0), (2, 15.0), seconds=1.0)
    assert scene.told((0, 4.0), (2, 6.0), seconds=0.1, speed=(0.0, 8.4))[1] is waits


def test_nobody_sets_off_while_somebody_comes_too_fast_to_stop() -> None:
    scene = Scene()
    assert scene.told((0, 4.0), (1, 50.0), seconds=1.0, speed=(0.0, 15.0)) == [True, False]
    assert scene.told((0, 4.0), (1, 50.0), seconds=1.0, speed=(0.0, 5.0)) == [False, False]


@pytest.mark.parametrize(("arms", "lit"), [(2, ()), (3, (_JUNCTION,))])
def test_merges_and_junctions_with_lights_have_no_turns(arms: int, lit: tuple[int, ...]) -> None:
    scene = Scene(arms, lit)
    assert scene.told((0, 4.0), (1, 4.0), seconds=1.0) == [False, False]
