"""Vehicles and walkers in a town: lost time, walls, zones, and the way down."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import Town
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import (
    EpisodeSettings,
    VehicleControl,
    WalkerControl,
)
from carstage_sim.world.mechanics import KILL_HEIGHT_M
from carstage_sim.world.pose import Pose
from carstage_sim.world.state import Collision
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
WALKER = "walker.pedestrian.0001"


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def world(stage01: Town, earlier: World) -> World:
    return World(stage01, episode_id=1, previous=earlier)


def place(town: Town, index: int = 0) -> Pose:
    x, y, z, pitch, yaw, roll = town.spawn_points[index].tolist()
    return Pose((x, y, z), (pitch, yaw, roll))


def tick(world: World, delta_s: float, settings: EpisodeSettings | None = None) -> None:
    physics = (settings or EpisodeSettings()).physics(delta_s)
    world.tick(delta_s, physics.substeps, moving_s=physics.duration_s)


def test_a_tick_beyond_all_substeps_moves_vehicles_by_their_product_only(
    world: World, stage01: Town
) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    tick(world, 0.05)
    before = np.array(world.actors.pose(car.actor_id).location)
    ahead = np.array(place(stage01).rotation_deg[1])
    velocity = (10.0 * math.cos(math.radians(ahead)), 10.0 * math.sin(math.radians(ahead)), 0.0)
    world.set_target_velocity(car.actor_id, velocity)
    tick(world, 0.5)  # ten substeps of a hundredth
    moved = np.linalg.norm(np.array(world.actors.pose(car.actor_id).location) - before)
    assert moved == pytest.approx(1.0, abs=0.1)
    assert world.elapsed_s == pytest.approx(0.55)


def to_the_nearest_building(world: World) -> tuple[Pose, float]:
    """A place in front of a long wall of a building, looking at it, and the distance."""
    obstacles = world.terrain.obstacles
    length = np.linalg.norm(obstacles.end - obstacles.start, axis=1)
    walls = np.flatnonzero((obstacles.label == CityObjectLabel.BUILDINGS) & (length > 12.0))
    for row in walls:
        middle = 0.5 * (obstacles.start[row] + obstacles.end[row])
        along = (obstacles.end[row] - obstacles.start[row]) / length[row]
        for side in (1.0, -1.0):
            outward = side * np.array([-along[1], along[0]])
            start = middle + 6.0 * outward
            yaw = math.atan2(-outward[1], -outward[0])
            way = np.array([[*(middle + d * outward), 0.15] for d in (3.2, 4.5, 6.0)])
            size, turned = np.tile([2.6, 1.2], (3, 1)), np.full(3, yaw)
            if not obstacles.contacts(np.arange(3), way, size, turned):
                place = (float(start[0]), float(start[1]), 0.6)
                return Pose(place, (0.0, math.degrees(yaw), 0.0)), 6.0
    raise AssertionError("no building stands free")


def collisions_of(world: World, actor: Actor, ticks: int) -> list[Collision]:
    found = []
    for _ in range(ticks):
        tick(world, 0.05)
        found += [c for c in world.collisions if actor.actor_id in (c.first_id, c.second_id)]
    return found


def test_a_building_stops_a_car_and_is_named_by_its_label(world: World) -> None:
    start, _ = to_the_nearest_building(world)
    car = world.spawn(CAR, {}, start)
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    found = collisions_of(world, car, 80)
    assert found
    assert {(c.second_id, c.label) for c in found} == {(0, CityObjectLabel.BUILDINGS)}
    forward = np.array([math.cos(math.radians(start.rotation_deg[1])), 0.0, 0.0])
    forward[1] = math.sin(math.radians(start.rotation_deg[1]))
    assert np.array(found[0].impulse) @ forward > 0.0
    gone = np.array(world.actors.pose(car.actor_id).location) - np.array(start.location)
    assert gone @ forward < 6.0


def test_a_building_that_was_taken_away_stops_nobody(world: World) -> None:
    start, _ = to_the_nearest_building(world)
    world.objects.enable([piece.object_id for piece in world.town.level_objects], False)
    car = world.spawn(CAR, {}, start)
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    assert collisions_of(world, car, 60) == []


def test_a_walker_does_not_walk_through_a_building(world: World) -> None:
    start, distance_m = to_the_nearest_building(world)
    walker = world.spawn(WALKER, {}, start._replace(location=(*start.location[:2], 1.1)))
    yaw = math.radians(start.rotation_deg[1])
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    world.control_walker(walker.actor_id, WalkerControl((*ahead.tolist(), 0.0), 4.0))
    for _ in range(60):
        tick(world, 0.05)
    gone = np.array(world.actors.pose(walker.actor_id).location[:2]) - start.location[:2]
    assert gone @ ahead < distance_m
    assert gone @ ahead > distance_m - 1.5


def ahead_of(pose: Pose, distance_m: float, height_m: float = 0.0) -> Pose:
    x, y, z = pose.location
    yaw = math.radians(pose.rotation_deg[1])
    there = (x + distance_m * math.cos(yaw), y + distance_m * math.sin(yaw), z + height_m)
    return Pose(there, pose.rotation_deg)


def test_a_car_knocks_a_walker_aside_and_both_are_named(world: World, stage01: Town) -> None:
    start = place(stage01)
    car = world.spawn(CAR, {}, start)
    walker = world.spawn(WALKER, {}, ahead_of(start, 8.0, 0.6))
    tick(world, 0.05)
    before = np.array(world.actors.pose(walker.actor_id).location)
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    found = collisions_of(world, car, 60)
    assert {(c.first_id, c.second_id) for c in found} == {(car.actor_id, walker.actor_id)}
    moved = np.array(world.actors.pose(walker.actor_id).location) - before
    assert np.linalg.norm(moved[:2]) > 1.0
    assert abs(moved[2]) < 0.3


def test_a_walker_does_not_walk_through_a_parked_car(world: World, stage01: Town) -> None:
    start = place(stage01)
    car = world.spawn(CAR, {}, start)
    world.control_vehicle(car.actor_id, VehicleControl(hand_brake=True))
    walker = world.spawn(WALKER, {}, ahead_of(start, 5.0, 0.6))
    tick(world, 0.05)
    yaw = math.radians(start.rotation_deg[1] + 180.0)
    world.control_walker(walker.actor_id, WalkerControl((math.cos(yaw), math.sin(yaw), 0.0), 2.0))
    for _ in range(60):
        tick(world, 0.05)
    apart = np.array(world.actors.pose(walker.actor_id).location[:2]) - start.location[:2]
    assert np.linalg.norm(apart) > 2.2


def test_a_prop_stops_a_car(world: World, stage01: Town) -> None:
    start = place(stage01)
    car = world.spawn(CAR, {}, start)
    prop = world.spawn("static.prop.streetbarrier", {}, ahead_of(start, 8.0, -0.5))
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    found = collisions_of(world, car, 60)
    assert {c.second_id for c in found} == {prop.actor_id}


def stopping_way(world: World, town: Town, friction: str | None, puddles: float = 0.0) -> float:
    start = place(town)
    car = world.spawn(CAR, {}, start)
    world.set_weather(replace(world.weather, precipitation_deposits=puddles))
    if friction is not None:
        extent = {f"extent_{axis}": "3000.0" for axis in "xyz"}
        world.spawn("static.trigger.friction", {"friction": friction, **extent}, start)
    tick(world, 0.05)
    yaw = math.radians(start.rotation_deg[1])
    world.set_target_velocity(car.actor_id, (10.0 * math.cos(yaw), 10.0 * math.sin(yaw), 0.0))
    world.control_vehicle(car.actor_id, VehicleControl(brake=1.0))
    before = np.array(world.actors.pose(car.actor_id).location)
    for _ in range(60):
        tick(world, 0.05)
    return float(np.linalg.norm(np.array(world.actors.pose(car.actor_id).location) - before))


def test_friction_triggers_and_water_lengthen_the_way_to_stop(
    stage01: Town, earlier: World
) -> None:
    def way(friction: str | None, puddles: float = 0.0, *, wet_grip: bool = True) -> float:
        world = World(stage01, episode_id=1, previous=earlier, wet_grip=wet_grip)
        return stopping_way(world, stage01, friction, puddles)

    dry = way(None)
    assert way(None, puddles=100.0, wet_grip=False) == dry
    assert way("3.5f") == pytest.approx(dry, rel=0.01)
    assert way("1.0") > 2.0 * dry
    assert dry < way(None, puddles=100.0) < 1.6 * dry


def test_tyres_in_a_friction_trigger_read_its_friction(world: World, stage01: Town) -> None:
    start = place(stage01)
    car = world.spawn(CAR, {}, start)

    def read() -> set[float]:
        return {wheel.tire_friction for wheel in world.parameters_in_effect(car).wheels}

    own = read()
    extent = {f"extent_{axis}": "3000.0" for axis in "xyz"}
    trigger = world.spawn("static.trigger.friction", {"friction": "5.0", **extent}, start)
    tick(world, 0.05)
    assert read() == {5.0}
    world.destroy(trigger.actor_id)
    assert read() == own


def test_what_falls_out_of_the_world_is_destroyed(world: World) -> None:
    car = world.spawn(CAR, {}, Pose((5000.0, 0.0, KILL_HEIGHT_M + 2.0)))
    walker = world.spawn(WALKER, {}, Pose((5010.0, 0.0, KILL_HEIGHT_M + 2.0)))
    low = Pose((5020.0, 0.0, KILL_HEIGHT_M + 2.0))
    falling, resting = (world.spawn("static.prop.trafficcone01", {}, low) for _ in range(2))
    world.set_simulate_physics(falling.actor_id, True)
    for _ in range(20):
        tick(world, 0.05)
    assert car.actor_id not in world.actors
    assert walker.actor_id not in world.actors
    assert falling.actor_id not in world.actors
    assert resting.actor_id in world.actors
    assert world.live_or_dead(car.actor_id) is car
