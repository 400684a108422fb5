"""Sensors that report events: what is sent, to whom, how often."""

from __future__ import annotations

from dataclasses import replace

import pytest

from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import CollisionFrame
from carstage_sim.world.state import Collision
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


TOUCHES = (Collision(3, 4, (10.0, 0.0, 0.0)), Collision(3, 9, (1.0, 2.0, 0.0)),
           Collision(4, 0, (0.0, 5.0, 0.0), label=3))  # fmt: skip


def events(sensors, owner_id, collisions=TOUCHES):
    sensors.reset()
    world = replace(state(1), collisions=collisions)
    found = sensors.capture(world, [request("other.collision", owner_id=owner_id)])
    return [frame for _, frame in found]


def test_a_carrier_gets_one_event_for_each_thing_it_touches(sensors):
    assert events(sensors, 3) == [
        CollisionFrame(3, 4, 0, (-10.0, 0.0, 0.0)),
        CollisionFrame(3, 9, 0, (-1.0, -2.0, 0.0)),
    ]


def test_the_impulse_is_the_carriers_own(sensors):
    town_first, car_second = events(sensors, 4)
    assert car_second == CollisionFrame(4, 3, 0, (10.0, 0.0, 0.0))
    assert town_first == CollisionFrame(4, 0, 3, (0.0, -5.0, 0.0))


def test_who_touches_nothing_and_who_is_carried_by_nothing_gets_no_event(sensors):
    assert events(sensors, 77) == []
    assert events(sensors, 0) == []
    assert events(sensors, 3, ()) == []


def test_collisions_need_no_rays(sensors):
    events(sensors, 3)
    assert sensors.last_cast_count == 0


def test_lane_invasion_is_left_to_the_client(sensors):
    assert sensors.capture(state(1), [request("other.lane_invasion", owner_id=3)]) == []
