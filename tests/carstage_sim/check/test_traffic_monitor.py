"""The traffic check must notice what it is there to notice."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.check.traffic import TrafficFigures, judge
from carstage_sim.check.traffic_monitor import TrafficMonitor, gap_m

EXTENT = np.array([2.4, 1.0, 0.75])


def monitor(count: int) -> TrafficMonitor:
    return TrafficMonitor(
        np.zeros((count, 3)), np.tile(EXTENT, (count, 1)), [f"v{i}" for i in range(count)]
    )


def sample(
    watched: TrafficMonitor,
    x: list[float],
    speed: list[float],
    held: list[bool],
    seconds: float = 100.0,
) -> None:
    location = np.array([[value, 0.0, 0.0] for value in x])
    watched.sample(seconds, location, np.zeros(len(x)), np.array(speed), np.array(held))


def test_gap_is_the_separation_or_minus_the_least_way_out() -> None:
    origin = np.zeros(3)
    assert gap_m(origin, EXTENT, 0.0, np.array([4.5, 0.5, 0.0]), EXTENT, 0.0) == (
        pytest.approx(-0.3)
    )
    assert gap_m(origin, EXTENT, 0.0, np.array([4.9, 0.0, 0.0]), EXTENT, 0.0) == (
        pytest.approx(0.1)
    )
    # Corner to corner, close in distance, but separated along the turned box's axis.
    assert gap_m(origin, EXTENT, 0.0, np.array([4.2, 2.7, 0.0]), EXTENT, 45.0) > 0.0


def test_touching_pairs_are_kept_with_their_narrowest_gap() -> None:
    watched = monitor(3)
    for x in (5.5, 4.81, 4.83):
        sample(watched, [0.0, x, 20.0], [5.0, 5.0, 5.0], [False] * 3)
    assert watched.touching == {(0, 1): pytest.approx(0.01)}
    assert watched.narrowest_gap_m == pytest.approx(0.01)


def test_a_vehicle_that_stands_alone_is_stuck() -> None:
    watched = monitor(2)
    sample(watched, [0.0, 50.0], [0.0, 5.0], [False, False])
    assert watched.longest_stand_s.tolist() == [100.0, 0.0]


def test_a_queue_behind_a_red_light_is_no_jam() -> None:
    watched = monitor(4)
    # The first waits at the light, two queue up behind it, the last stands far behind.
    sample(watched, [100.0, 93.0, 84.0, 40.0], [0.0] * 4, [True, False, False, False])
    assert watched.longest_stand_s.tolist() == [0.0, 0.0, 0.0, 100.0]


def test_standing_ends_when_the_vehicle_moves() -> None:
    watched = monitor(1)
    for speed in (0.0, 0.0, 3.0, 0.0):
        sample(watched, [0.0], [speed], [False], seconds=10.0)
    assert watched.longest_stand_s.tolist() == [20.0]
    assert watched.standing_s.tolist() == [10.0]


def test_a_vehicle_that_is_gone_does_not_poison_the_rest() -> None:
    watched = monitor(2)
    sample(watched, [0.0, 30.0], [5.0, 5.0], [False, False])
    sample(watched, [10.0, np.nan], [5.0, np.nan], [False, False])
    assert watched.distance_m.tolist() == [10.0, 0.0]
    assert watched.touching == {}


def test_only_a_moving_vehicle_hits_a_walker() -> None:
    watched = monitor(2)
    walkers = np.array([[2.0, 0.5], [2.0, 1.5], [51.0, 0.0]])
    location = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    watched.sample_walkers(walkers, location, np.zeros(2), np.array([5.0, 0.0]))
    assert watched.hit == {0}


def good_figures() -> TrafficFigures:
    return TrafficFigures(
        vehicles=50,
        simulated_s=300.0,
        mean_distance_m=1000.0,
        mean_speed_kmh=12.0,
        moved_in_last_minute=1.0,
    )


def test_good_figures_pass() -> None:
    assert judge(good_figures()).ok


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("destroyed", 1),
        ("stuck", 1),
        ("longest_stand_s", 91.0),
        ("touching", 1),
        ("narrowest_gap_m", 0.0),
        ("walkers_hit", 1),
        ("red_lights_run", 1),
        ("mean_speed_kmh", 2.0),
        ("mean_distance_m", 100.0),
        ("moved_in_last_minute", 0.5),
        ("moved_in_last_minute", float("nan")),
    ],
)
def test_each_bad_figure_fails(name: str, value: float) -> None:
    figures = good_figures()
    setattr(figures, name, value)
    assert not judge(figures).ok
