"""Walkers under a client's control, and what is teleported, dropped or left behind."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import WalkerControl
from carstage_sim.world.pose import Pose
from carstage_sim.world.world import World

WALKER = "walker.pedestrian.0001"
CAR = "vehicle.tesla.model3"
DELTA_S = 0.05


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def world(stage01: Town, earlier: World) -> World:
    return World(stage01, episode_id=1, previous=earlier)


def spawned(world: World, type_id: str, height_m: float, index: int = 3) -> Actor:
    x, y, z, *_ = world.town.spawn_points[index].tolist()
    return world.spawn(type_id, {}, Pose((x, y, z + height_m), (0.0, 50.0, 0.0)))


def place(world: World, actor: Actor) -> np.ndarray:
    return np.array(world.actors.pose(actor.actor_id).location)


def after(world: World, seconds: float) -> None:
    for _ in range(round(seconds / DELTA_S)):
        world.tick(DELTA_S)


@pytest.mark.parametrize(("length", "metres"), [(0.5, 0.75), (1.0, 1.5), (5.0, 7.5)])
def test_the_length_of_the_direction_counts(world: World, length: float, metres: float) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    before = place(world, walker)
    direction = np.array([np.cos(np.radians(50)), np.sin(np.radians(50)), 0.0]) * length
    world.control_walker(walker.actor_id, WalkerControl(tuple(direction.tolist()), 1.5))
    after(world, 1.0)
    assert np.linalg.norm(place(world, walker) - before) == pytest.approx(metres, rel=0.02)


def test_a_walker_of_negative_speed_goes_the_other_way(world: World) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    before = place(world, walker)
    ahead = np.array([np.cos(np.radians(50)), np.sin(np.radians(50)), 0.0])
    world.control_walker(walker.actor_id, WalkerControl(tuple(ahead.tolist()), -1.5))
    after(world, 1.0)
    assert place(world, walker) - before == pytest.approx(-1.5 * ahead, abs=0.02)
    assert world.actors.pose(walker.actor_id).rotation_deg[1] == pytest.approx(-130.0)


def test_a_new_walker_s_control_points_ahead_as_carla_s_does(world: World) -> None:
    walker = spawned(world, WALKER, 1.0)
    assert walker.walker == WalkerControl((1.0, 0.0, 0.0), 0.0)


@pytest.mark.parametrize("what", ["static.prop.vendingmachine", "static.prop.barrel", WALKER])
def test_a_walker_stops_at_props_and_at_who_stands(world: World, what: str) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    start = place(world, walker)
    ahead = np.array([np.cos(np.radians(50)), np.sin(np.radians(50)), 0.0])
    x, y, z = (start + 4.0 * ahead).tolist()
    height = z if what == WALKER else z - walker.box_extent[2]
    other = world.spawn(what, {}, Pose((x, y, height), (0.0, 50.0, 0.0)))
    world.control_walker(walker.actor_id, WalkerControl(tuple(ahead.tolist()), 1.5))
    after(world, 5.0)
    room_m = walker.box_extent[0] + other.box_extent[0]
    assert place(world, walker) @ ahead - start @ ahead == pytest.approx(4.0 - room_m, abs=0.3)
    world.set_collides(walker.actor_id, False)
    after(world, 3.0)
    assert place(world, walker) @ ahead - start @ ahead > 5.0


@pytest.mark.parametrize("again", [World.set_enable_gravity, World.set_simulate_physics])
def test_a_walker_without_gravity_walks_on_and_hangs_where_it_lost_it_in_the_air(
    world: World, again: Callable[[World, int, bool], None]
) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    before = place(world, walker)
    world.set_enable_gravity(walker.actor_id, False)
    world.control_walker(walker.actor_id, WalkerControl((0.6, 0.8, 0.5), 1.5))
    after(world, 1.0)
    walked = place(world, walker) - before
    assert np.hypot(*walked[:2]) == pytest.approx(1.5, rel=0.05)
    assert abs(walked[2]) < 0.2
    x, y, z = before.tolist()
    world.set_pose(walker.actor_id, Pose((x, y, z + 20.0)))
    after(world, 0.5)
    falling = place(world, walker)
    assert falling[2] < z + 19.5
    for _ in range(2):
        world.set_enable_gravity(walker.actor_id, False)
        after(world, 1.0)
        np.testing.assert_allclose(place(world, walker), falling)
    again(world, walker.actor_id, True)
    after(world, 3.0)
    assert place(world, walker)[2] < z + 0.5


def test_a_jump_is_of_carlas_height(world: World) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    before = place(world, walker)
    world.control_walker(walker.actor_id, WalkerControl(jump=True))
    world.tick(DELTA_S)
    world.control_walker(walker.actor_id, WalkerControl())
    heights = []
    for _ in range(30):
        heights.append(place(world, walker)[2] - before[2])
        world.tick(DELTA_S)
    assert max(heights) == pytest.approx(5.0**2 / (2 * 9.81), rel=0.05)
    assert heights[-1] == pytest.approx(0.0, abs=1e-6)


def velocity(world: World, actor: Actor) -> np.ndarray:
    return np.array(world.actors.velocity[world.actors.row(actor.actor_id)])


def test_however_fast_a_walker_goes_it_tells_its_velocity(world: World) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    ahead = (float(np.cos(np.radians(50))), float(np.sin(np.radians(50))), 0.0)
    world.control_walker(walker.actor_id, WalkerControl(ahead, 20.0))
    after(world, 0.15)
    assert np.linalg.norm(velocity(world, walker)) == pytest.approx(20.0, rel=0.01)


def test_a_walker_that_comes_with_its_feet_in_the_ground_does_not_jump_out(world: World) -> None:
    walker = spawned(world, WALKER, 0.0)
    before = place(world, walker)
    world.tick(DELTA_S)
    assert place(world, walker)[2] > before[2] + 0.1
    assert velocity(world, walker).tolist() == [0.0, 0.0, 0.0]


def test_a_walker_s_teleport_is_not_motion(world: World) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    x, y, z = place(world, walker)
    world.set_location(walker.actor_id, (x + 0.5, y, z))
    world.tick(DELTA_S)
    assert velocity(world, walker).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("height_m", [0.0, 0.3, 0.6])
def test_a_walker_teleported_to_the_ground_stands_on_it(world: World, height_m: float) -> None:
    walker = spawned(world, WALKER, 1.0)
    after(world, 0.5)
    before = place(world, walker)
    x, y, z, *_ = world.town.spawn_points[5].tolist()
    road = z - 0.5 if z > 0.4 else 0.0
    world.set_location(walker.actor_id, (x, y, road + height_m))
    after(world, 2.0)
    assert place(world, walker)[2] == pytest.approx(before[2], abs=0.3)


def test_a_sensor_that_is_moved_on_its_car_keeps_its_turn(world: World) -> None:
    car = spawned(world, CAR, 0.3)
    mount = Pose((0.5, 0.0, 1.5), (0.0, 20.0, 0.0))
    sensor = world.spawn("sensor.other.gnss", {}, mount, parent_id=car.actor_id)
    for _ in range(3):
        world.set_location(sensor.actor_id, (2.0, 0.0, 1.5))
        world.tick(DELTA_S)
    turn = world.actors.pose(sensor.actor_id).rotation_deg[1]
    assert turn - world.actors.pose(car.actor_id).rotation_deg[1] == pytest.approx(20.0, abs=0.1)


def test_what_rode_on_a_car_stands_when_the_car_is_gone(world: World) -> None:
    car = spawned(world, CAR, 0.3)
    sensor = world.spawn("sensor.other.gnss", {}, Pose((0.0, 0.0, 2.0)), parent_id=car.actor_id)
    world.set_target_velocity(car.actor_id, (5.0, 0.0, 0.0))
    after(world, 0.2)
    row = world.actors.row(sensor.actor_id)
    assert np.linalg.norm(world.actors.velocity[row]) > 2.0
    world.destroy(car.actor_id)
    world.tick(DELTA_S)
    assert not world.actors.velocity[world.actors.row(sensor.actor_id)].any()


def test_a_falling_prop_whose_physics_end_is_at_rest(world: World) -> None:
    prop = spawned(world, "static.prop.barrel", 20.0)
    world.set_simulate_physics(prop.actor_id, True)
    after(world, 0.5)
    assert velocity(world, prop)[2] < -4.0
    world.set_simulate_physics(prop.actor_id, False)
    before = place(world, prop)
    world.tick(DELTA_S)
    assert place(world, prop).tolist() == before.tolist()
    assert velocity(world, prop).tolist() == [0.0, 0.0, 0.0]


def test_a_prop_with_physics_falls_and_lies(world: World) -> None:
    prop = spawned(world, "static.prop.barrel", 2.5)
    after(world, 0.5)
    hangs = place(world, prop)[2]
    world.set_simulate_physics(prop.actor_id, True)
    after(world, 0.2)
    assert hangs - place(world, prop)[2] == pytest.approx(0.5 * 9.81 * 0.2**2, rel=0.05)
    after(world, 2.0)
    lies = place(world, prop)[2]
    x, y, z = place(world, prop).tolist()
    bottom = z + prop.box_center[2] - prop.box_extent[2]
    ground = world.terrain.ground.highest(np.array([[x, y]]))[0]
    assert bottom == pytest.approx(ground, abs=1e-6)
    after(world, 0.5)
    assert place(world, prop)[2] == lies
