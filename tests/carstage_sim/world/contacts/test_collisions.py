"""What collision sensors are told: who touched whom, and the impulse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.maps.spawning import HEIGHT_M
from carstage_sim.world.actors import Actor
from carstage_sim.world.contacts.solids import WALKER_MASS_KG
from carstage_sim.world.pose import Pose, compose
from carstage_sim.world.state import Collision
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
WALKER = "walker.pedestrian.0001"
DELTA_S = 0.05


@pytest.fixture
def world(stage01: Town) -> World:
    return World(stage01, episode_id=1)


def ahead(world: World, type_id: str, distance_m: float) -> tuple[Actor, Actor]:
    """A car at the first spawn point and something before it."""
    x, y, z, pitch, yaw, roll = world.town.spawn_points[0].tolist()
    place = Pose((x, y, z), (pitch, yaw, roll))
    car = world.spawn(CAR, {}, place)
    return car, world.spawn(type_id, {}, compose(place, Pose((distance_m, 0.0, 0.5))))


def first_collisions(world: World, ticks: int = 40) -> tuple[Collision, ...]:
    for _ in range(ticks):
        collisions = world.tick(DELTA_S, 5).state.collisions
        if collisions:
            return collisions
    return ()


def drive(world: World, car: Actor, speed: float) -> None:
    yaw = math.radians(world.actors.pose(car.actor_id).rotation_deg[1])
    world.set_target_velocity(car.actor_id, (speed * math.cos(yaw), speed * math.sin(yaw), 0.0))


def test_no_collision_without_a_touch(world: World) -> None:
    ahead(world, CAR, 12.0)
    assert first_collisions(world) == ()


@pytest.mark.parametrize(
    ("prop", "above_road_m", "stops"),
    [
        ("static.prop.ironplank", 0.0, False),
        ("static.prop.dirtdebris02", 0.0, False),
        ("static.prop.trafficcone01", 0.0, True),
        ("static.prop.trafficcone01", 1.8, False),
        ("static.prop.trafficcone01", -1.2, False),
    ],
)
def test_a_car_drives_over_what_is_flat_and_under_what_is_high(
    world: World, prop: str, above_road_m: float, stops: bool
) -> None:
    x, y, z, pitch, yaw, roll = world.town.spawn_points[0].tolist()
    place = Pose((x, y, z), (pitch, yaw, roll))
    car = world.spawn(CAR, {}, place)
    world.spawn(prop, {}, compose(place, Pose((8.0, 0.0, above_road_m - HEIGHT_M))))
    drive(world, car, 10.0)
    found = first_collisions(world)
    assert bool(found) is stops
    behind = math.dist(world.actors.pose(car.actor_id).location[:2], (x, y)) > 9.0
    assert behind is not stops


def test_a_rear_end_reports_both_cars_and_the_momentum_that_passed(world: World) -> None:
    car, other = ahead(world, CAR, 8.0)
    drive(world, car, 10.0)
    (collision,) = first_collisions(world)
    assert (collision.first_id, collision.second_id) == (car.actor_id, other.actor_id)
    assert collision.label == 0
    forward = np.array(world.actors.velocity[world.actors.row(other.actor_id)])
    mass_kg = world.parameters(other).mass_kg
    impulse = np.array(collision.impulse)
    assert impulse @ forward > 0.0  # the second one is pushed on
    assert np.linalg.norm(impulse) == pytest.approx(mass_kg * 5.0, rel=0.15)


def test_a_walker_that_is_run_over_is_reported_while_a_sensor_could_tell(world: World) -> None:
    car, walker = ahead(world, WALKER, 6.0)
    drive(world, car, 8.0)
    assert first_collisions(world, 5) == ()
    world.spawn("sensor.other.collision", {}, Pose(), parent_id=car.actor_id)
    (collision,) = first_collisions(world)
    assert (collision.first_id, collision.second_id) == (car.actor_id, walker.actor_id)
    mass_kg = world.parameters(car).mass_kg
    shared_kg = 1.0 / (1.0 / mass_kg + 1.0 / WALKER_MASS_KG)
    assert np.linalg.norm(collision.impulse) == pytest.approx(shared_kg * 8.0, rel=0.1)
    forward = world.actors.velocity[world.actors.row(car.actor_id)]
    assert np.array(collision.impulse) @ forward > 0.0


def test_a_walker_whose_collisions_are_off_is_not_reported(world: World) -> None:
    car, walker = ahead(world, WALKER, 6.0)
    world.spawn("sensor.other.collision", {}, Pose(), parent_id=car.actor_id)
    world.set_collides(walker.actor_id, False)
    drive(world, car, 8.0)
    assert first_collisions(world) == ()


def test_a_collision_ends_with_the_touch(world: World) -> None:
    car, other = ahead(world, CAR, 8.0)
    drive(world, car, 10.0)
    assert first_collisions(world)
    world.destroy(other.actor_id)
    assert world.tick(DELTA_S, 5).state.collisions == ()
