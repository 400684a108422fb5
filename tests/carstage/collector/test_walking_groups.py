"""People who walk together begin, walk and wait side by side; some sit in wheelchairs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import carla
import numpy as np
import pytest

from carstage.collector.actors import Walker
from carstage.collector.crosswalks import Crosswalk
from carstage.collector.sidewalks import SPACING_M, abreast, group_sizes
from carstage.collector.walking_groups import ASIDE_M, LOST_M, WalkingGroups
from carstage.rawlog.reader import EpisodeLog
from running_collector import Collector

SPEED_M_S = 1.2


@pytest.mark.parametrize("people", range(12))
def test_groups_are_pairs_and_threes_and_nobody_is_in_two(people: int) -> None:
    for seed in range(20):
        sizes = group_sizes(people, random.Random(seed))
        assert set(sizes) <= {2, 3}
        assert people - sum(sizes) in (0, 1)


def sidewalk(width_m: float) -> Any:
    """A map with one sidewalk along x, whose middle is at y = 5."""

    def waypoint(place: Any, project: bool, kind: Any) -> Any:
        assert kind == carla.LaneType.Sidewalk
        transform = carla.Transform(carla.Location(place.x, 5.0, 0.2))
        return SimpleNamespace(transform=transform, lane_width=width_m)

    return SimpleNamespace(get_waypoint=waypoint)


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("y", [3.6, 5.0, 6.4])
def test_places_abreast_lie_across_the_sidewalk_and_on_it(size: int, y: float) -> None:
    places = abreast(sidewalk(3.0), carla.Location(20.0, y, 0.2), size)
    assert len(places) == size
    ys = sorted(place.y for place in places)
    assert {round(place.x, 5) for place in places} == {20.0}
    np.testing.assert_allclose(np.diff(ys), SPACING_M, atol=1e-5)
    assert ys[0] > 3.5 + 0.39
    assert ys[-1] < 6.5 - 0.39


def test_a_narrow_sidewalk_has_no_room_abreast() -> None:
    assert not abreast(sidewalk(1.5), carla.Location(20.0, 5.0, 0.2), 2)
    assert not abreast(sidewalk(2.2), carla.Location(20.0, 5.0, 0.2), 3)
    assert not abreast(sidewalk(3.0), carla.Location(20.0, 9.0, 0.2), 2)  # it is elsewhere
    nothing: Any = SimpleNamespace(get_waypoint=lambda *_: None)
    assert not abreast(nothing, carla.Location(20.0, 5.0, 0.2), 2)


class Street:
    """A leader, 1, at the origin, and who goes with it, as the client has them."""

    def __init__(self, *places: tuple[float, float], leads_m_s: float = SPEED_M_S) -> None:
        self.places = [(0.0, 0.0), *places]
        self.leads_m_s = leads_m_s
        self.speeds: dict[int, list[float]] = {}
        self.sent: dict[int, list[Any]] = {}
        self.held: set[int] = set()
        self.crosswalk: Crosswalk | None = None
        self.world = self

    def get_snapshot(self) -> Any:
        return self

    def find(self, number: int) -> Any:
        place = self.places[number - 1]
        velocity = carla.Vector3D(self.leads_m_s if number == 1 else 0.0, 0.0, 0.0)
        return SimpleNamespace(
            get_transform=lambda: carla.Transform(carla.Location(*place, 0.0)),
            get_velocity=lambda: velocity,
        )

    def step(self, steps: int = 1) -> None:
        walkers = []
        for number in range(1, len(self.places) + 1):
            self.speeds[number], self.sent[number] = [], []
            controller = SimpleNamespace(
                set_max_speed=self.speeds[number].append, go_to_location=self.sent[number].append
            )
            actor = SimpleNamespace(id=number)
            leader = 1 if number > 1 else None
            walkers.append(Walker(actor, controller, SPEED_M_S, leader=leader))
        street: Any = self
        rules: Any = SimpleNamespace(
            holds=lambda number: number in self.held, crosswalk_at=lambda _place: self.crosswalk
        )
        self.groups = WalkingGroups(street, walkers, 0.5, rules)
        for _ in range(steps):
            self.groups.before_step()


def test_who_goes_with_somebody_is_sent_beside_where_that_one_will_be() -> None:
    street = Street((0.0, 0.9))
    street.step()
    (goal,) = street.sent[2]
    assert goal.x > 2.0
    assert goal.y == pytest.approx(ASIDE_M)
    assert street.speeds[2] == [pytest.approx(SPEED_M_S)]
    assert not street.sent[1], "who leads goes its own way"
    assert not street.speeds[1]


@pytest.mark.parametrize(("ahead_m", "faster"), [(-1.0, True), (1.0, False)])
def test_who_is_behind_hurries_and_who_is_ahead_slows_down(ahead_m: float, faster: bool) -> None:
    street = Street((ahead_m, -0.9))
    street.step()
    assert (street.speeds[2][0] > SPEED_M_S) is faster
    assert 0.5 * SPEED_M_S < street.speeds[2][0] < 1.5 * SPEED_M_S
    assert street.sent[2][0].y < 0.0


def test_two_who_go_with_one_take_both_sides() -> None:
    street = Street((0.0, 0.9), (-0.2, 0.4))
    street.step(4)
    assert {math.copysign(1.0, goal.y) for goal in street.sent[2]} == {1.0}
    assert {math.copysign(1.0, goal.y) for goal in street.sent[3]} == {-1.0}


def test_who_is_beside_one_that_stands_stands_too_and_who_is_not_comes() -> None:
    street = Street((0.3, 0.9), (-4.0, 0.0), leads_m_s=0.0)
    street.step()
    assert street.speeds[2] == [0.0]
    assert not street.sent[2]
    assert street.speeds[3] == [SPEED_M_S]
    assert (street.sent[3][0].x, street.sent[3][0].y) == (0.0, 0.0)


def test_who_is_held_at_a_kerb_or_lost_is_let_be() -> None:
    street = Street((0.0, 0.9), (-LOST_M - 1.0, 0.0))
    street.held = {2}
    street.step()
    assert not street.speeds[2]
    assert not street.sent[2]
    assert street.speeds[3] == [SPEED_M_S]
    assert not street.sent[3]


def test_over_a_crosswalk_each_is_sent_once_and_again_when_it_was_held() -> None:
    street = Street((-1.5, 0.9))
    # A road of 8 m along y; the leader is at its near end.
    street.crosswalk = Crosswalk((4.0, 0.0), 0.0, (1.0, 0.0), 4.0, 1.75)
    street.step(3)
    (goal,) = street.sent[2]
    assert goal.x > 8.0
    assert abs(goal.y) < 1.75
    assert street.speeds[2] == [SPEED_M_S]
    street.held = {2}
    street.groups.before_step()
    assert len(street.sent[2]) == 1
    street.held = set()
    street.groups.before_step()
    assert [(one.x, one.y) for one in street.sent[2]] == [(goal.x, goal.y)] * 2
    street.places = [(9.0, 0.0), (8.5, 0.9)]
    street.crosswalk = None
    street.groups.before_step()
    assert street.sent[2][-1].x > 11.0, "beside the leader again"


def test_who_is_over_already_is_not_sent_back_and_forth() -> None:
    street = Street((9.0, 0.5))
    street.places[0] = (5.0, 0.0)
    street.crosswalk = Crosswalk((4.0, 0.0), 0.0, (1.0, 0.0), 4.0, 1.75)
    street.step()
    assert street.sent[2][0].y == pytest.approx(ASIDE_M)


PlanMaker = Callable[..., dict[str, Any]]


def recorded(
    collector: Collector, make_plan: PlanMaker, folder: Path, **people: Any
) -> tuple[EpisodeLog, list[int], np.ndarray]:
    """The log, ids of the walkers and their places ``(T, N, 2)``, m."""
    pose = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
    sensor = {"id": "GNSS", "kind": "gnss", "blueprint": "sensor.other.gnss", "attributes": {},
              "pose": pose}  # fmt: skip
    plan = make_plan(
        folder, steps=120, sensors=[sensor], vehicles={"count": 0, "filter": "vehicle.*"},
        pedestrians={"filter": "walker.pedestrian.*", **people},
    )  # fmt: skip
    code, events = collector.run(plan)
    assert code == 0, [event for event in events if event["event"] == "error"]
    log = EpisodeLog(folder)
    actors = log.actors()
    ids = [one for one, row in actors.items() if row.type_id.startswith("walker.")]
    frames = [frame for i in log.sealed_segments("world") for frame in log.world_frames(i)]
    at = np.array([[frame.location[frame.row(one)][:2] for one in ids] for frame in frames])
    return log, ids, at


@pytest.mark.end_to_end
@pytest.mark.xdist_group("collector")
def test_groups_keep_together_on_their_way(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    _, ids, at = recorded(collector, make_plan, tmp_path / "raw", count=9, in_groups_percent=100.0)
    assert len(ids) == 9
    away = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)
    together = (away[0] < 2.5 * SPACING_M) & ~np.eye(9, dtype=bool)
    assert together.any(axis=1).sum() >= 8, "one of nine may be left over"
    way = np.linalg.norm(at[-1] - at[0], axis=1)
    assert np.median(way) > 5.0
    # Twelve seconds later whoever was beside one is still there.
    nearest = np.where(together, away, np.inf).min(axis=2)[:, together.any(axis=1)]
    assert (nearest < 2.5).mean() > 0.9
    assert nearest.min() > 0.3


@pytest.mark.end_to_end
@pytest.mark.xdist_group("collector")
def test_wheelchairs_are_used_by_those_who_can_and_plans_repeat(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    people = {"count": 8, "in_groups_percent": 50.0, "wheelchair_percent": 100.0}
    log, ids, at = recorded(collector, make_plan, tmp_path / "one", **people)
    actors = log.actors()
    for one in ids:
        attributes = actors[one].attributes
        assert attributes["use_wheelchair"] == attributes["can_use_wheelchair"]
        sits = attributes["use_wheelchair"] == "true"
        assert (actors[one].box_extent[2] == pytest.approx(0.73)) == sits
    assert any(actors[one].attributes["use_wheelchair"] == "true" for one in ids)
    _, _, again = recorded(collector, make_plan, tmp_path / "two", **people)
    assert np.array_equal(at, again)
