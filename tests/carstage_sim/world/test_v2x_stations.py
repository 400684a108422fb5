"""When V2X stations send: ETSI's rule for awareness messages, and clients' texts."""

from __future__ import annotations

import itertools

import pytest

from carstage_sim.maps import Town
from carstage_sim.world.pose import Pose
from carstage_sim.world.transmissions import CUSTOM_SENSOR, StationType
from carstage_sim.world.v2x import CamClock
from carstage_sim.world.world import World

DEFAULTS = {"gen_cam_min": "0.1", "gen_cam_max": "1.0", "fixed_rate": "false"}


def sent(
    pose_at, speed_at=lambda _: 0.0, *, seconds=3.0, step_s=0.05, kind=StationType.PASSENGER_CAR,
    **attributes,
):  # fmt: skip
    """Times at which a station sends."""
    clock = CamClock(DEFAULTS | attributes, kind)
    times = [round(step_s * (number + 1), 6) for number in range(round(seconds / step_s))]
    return [now for now in times if clock.is_due(now, pose_at(now), speed_at(now))]


def still(_now: float) -> Pose:
    return Pose()


def test_who_stands_sends_once_a_second() -> None:
    assert sent(still) == [0.05, 1.05, 2.05]


def test_who_drives_sends_every_four_metres() -> None:
    times = sent(lambda now: Pose((9.0 * now, 0.0, 0.0)), lambda _: 9.0)
    assert times[1] - times[0] == pytest.approx(0.45)
    assert times[2] - times[1] == pytest.approx(0.45)


def test_nobody_sends_more_often_than_the_shortest_time() -> None:
    times = sent(lambda now: Pose((200.0 * now, 0.0, 0.0)), lambda _: 200.0, seconds=1.0)
    assert all(later - now >= 0.1 - 1e-6 for now, later in itertools.pairwise(times))
    assert len(times) == 10


def test_a_turn_and_a_brake_are_sent_at_once() -> None:
    turned = sent(lambda now: Pose((0.0, 0.0, 0.0), (0.0, 5.0 if now > 0.52 else 0.0, 0.0)))
    assert turned[1] == 0.55
    braked = sent(still, lambda now: 1.0 if now > 0.52 else 0.0)
    assert braked[1] == 0.55


def test_after_three_messages_without_a_change_the_period_is_the_longest() -> None:
    moved = sent(lambda now: Pose((5.0 if now > 0.22 else 0.0, 0.0, 0.0)), seconds=4.0)
    gaps = [round(later - now, 3) for now, later in itertools.pairwise(moved)][:6]
    assert gaps == [0.2, 0.2, 0.2, 0.2, 1.0, 1.0]


def test_a_fixed_rate_is_the_shortest_time() -> None:
    assert sent(still, seconds=0.5, fixed_rate="True", gen_cam_min="0.2") == [0.05, 0.25, 0.45]


def test_roadside_units_send_twice_a_second() -> None:
    assert sent(still, seconds=1.6, kind=StationType.ROADSIDE_UNIT) == [0.05, 0.55, 1.05, 1.55]


def test_what_seldom_changes_is_sent_twice_a_second() -> None:
    clock = CamClock(DEFAULTS, StationType.PASSENGER_CAR)
    taken = [clock.takes_low_frequency(0.1 * number) for number in range(1, 12)]
    assert [number for number, one in enumerate(taken) if one] == [0, 5, 10]


def test_a_text_is_forgotten_after_a_tick_even_if_nobody_sends_it(stage01: Town) -> None:
    world = World(stage01, episode_id=0)
    gone = world.spawn(CUSTOM_SENSOR, {}, Pose())
    world.destroy(gone.actor_id)
    world.v2x.send(gone.actor_id + 1, "of another tick")
    world.tick(0.05, 5)
    sensor = world.spawn(CUSTOM_SENSOR, {}, Pose())
    assert sensor.actor_id == gone.actor_id + 1
    world.tick(0.05, 5)
    assert world.v2x.transmissions == ()
    world.v2x.send(sensor.actor_id, "of this tick")
    world.tick(0.05, 5)
    assert [sent.text for sent in world.v2x.transmissions] == ["of this tick"]
    world.tick(0.05, 5)
    assert world.v2x.transmissions == ()
