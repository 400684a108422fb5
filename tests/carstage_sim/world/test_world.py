from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.geometry import pose_matrix
from carstage_sim.maps import Town
from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.snapshot import encode_snapshot
from carstage_sim.world.controls import (
    AckermannControl,
    EpisodeSettings,
    VehicleControl,
    WalkerControl,
)
from carstage_sim.world.errors import ActorError, ActorNotFoundError, ActorTypeError, SpawnError
from carstage_sim.world.pictures import PlacedPicture
from carstage_sim.world.pose import Pose, Vector3, compose
from carstage_sim.world.signals.traffic_lights import TrafficLightState
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.town_objects import MOST_TEXELS
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
WALKER = "walker.pedestrian.0001"
CAMERA = "sensor.camera.rgb"
DELTA_S = 0.05


def place(town: Town, index: int = 0) -> Pose:
    x, y, z, pitch, yaw, roll = town.spawn_points[index].tolist()
    return Pose((x, y, z), (pitch, yaw, roll))


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def world(stage01: Town, earlier: World) -> World:
    return World(stage01, episode_id=1, previous=earlier)


def ticks(world: World, count: int) -> Snapshot:
    snapshot = world.tick(DELTA_S, 5)
    for _ in range(count - 1):
        snapshot = world.tick(DELTA_S, 5)
    return snapshot


def test_same_commands_give_the_same_bytes_in_the_next_episode(stage01: Town) -> None:
    def episode(previous: World | None) -> tuple[World, list[bytes]]:
        world = World(stage01, episode_id=1, previous=previous)
        car = world.spawn(CAR, {"color": "10,20,30"}, place(stage01))
        world.spawn(CAMERA, {}, Pose((1.0, 0.0, 2.0)), parent_id=car.actor_id)
        world.control_vehicle(car.actor_id, VehicleControl(throttle=0.7, steer=0.1))
        frames = [world.tick(DELTA_S, 5) for _ in range(20)]
        return world, [encode_snapshot(frame, dialect("0.9.16"), 0.0) for frame in frames]

    world, first = episode(None)
    _, second = episode(world)
    assert first == second


def test_frames_count_by_one_and_time_by_the_step(world: World) -> None:
    snapshot = ticks(world, 10)
    assert (snapshot.state.frame, world.frame) == (11, 11)
    assert snapshot.state.timestamp_s == pytest.approx(0.5)
    assert not snapshot.map_changed


def test_first_frame_of_an_episode_says_that_the_map_changed(world: World) -> None:
    assert world.freeze(0.0).map_changed


def test_every_live_actor_is_in_the_snapshot_in_ascending_order(
    world: World, stage01: Town
) -> None:
    cars = [world.spawn(CAR, {}, place(stage01, index)) for index in (0, 20, 40)]
    world.destroy(cars[1].actor_id)
    ids = ticks(world, 1).state.actor_id.tolist()
    expected = [*world.light_ids, world.spectator.actor_id, cars[0].actor_id, cars[2].actor_id]
    assert ids == sorted(expected)


def test_snapshot_does_not_change_when_the_world_goes_on(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    snapshot = ticks(world, 5)
    before = encode_snapshot(snapshot, dialect("0.9.16"), 0.0)
    ticks(world, 5)
    assert encode_snapshot(snapshot, dialect("0.9.16"), 0.0) == before


@pytest.mark.parametrize(
    ("location", "rotation"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((1.5, -0.5, 1.6), (-10.0, 135.0, 0.0)),
        ((-2.0, 1.0, 0.4), (30.0, -60.0, 45.0)),
    ],
)
def test_attached_sensor_is_where_its_parent_carries_it(
    world: World,
    stage01: Town,
    location: tuple[float, float, float],
    rotation: tuple[float, float, float],
) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    sensor = world.spawn(CAMERA, {}, Pose(location, rotation), parent_id=car.actor_id)
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0, steer=0.5))
    ticks(world, 3)
    expected = compose(world.actors.pose(car.actor_id), Pose(location, rotation))
    pose = world.actors.pose(sensor.actor_id)
    np.testing.assert_allclose(pose.location, expected.location, atol=1e-9)
    np.testing.assert_allclose(
        pose_matrix(pose.location, pose.rotation_deg),
        pose_matrix(expected.location, expected.rotation_deg),
        atol=1e-9,
    )


def test_sensor_stays_in_place_when_its_parent_is_destroyed(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    sensor = world.spawn(CAMERA, {}, Pose((0.0, 0.0, 2.0)), parent_id=car.actor_id)
    ticks(world, 2)
    before = world.actors.pose(sensor.actor_id)
    world.destroy(car.actor_id)
    ticks(world, 2)
    assert world.actors.pose(sensor.actor_id) == before


def test_solid_actors_are_not_spawned_into_each_other(world: World, stage01: Town) -> None:
    world.spawn(CAR, {}, place(stage01))
    for type_id in (CAR, WALKER):
        with pytest.raises(SpawnError, match="because of collision at spawn position"):
            world.spawn(type_id, {}, place(stage01))
    world.spawn(CAMERA, {}, place(stage01))


def test_refused_spawn_leaves_nothing_behind(world: World, stage01: Town) -> None:
    first = world.spawn(CAR, {}, place(stage01))
    with pytest.raises(SpawnError):
        world.spawn(CAR, {}, place(stage01))
    second = world.spawn(CAR, {}, place(stage01, 20))
    assert second.actor_id == first.actor_id + 1


def test_actor_without_collisions_is_no_obstacle(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    world.set_collides(car.actor_id, False)
    world.spawn(CAR, {}, place(stage01))


def test_unknown_blueprint_and_parent_are_refused(world: World) -> None:
    with pytest.raises(SpawnError, match=r"vehicle\.none"):
        world.spawn("vehicle.none", {}, Pose())
    with pytest.raises(SpawnError, match="parent actor 999"):
        world.spawn(CAMERA, {}, Pose(), parent_id=999)


def test_values_of_fixed_attributes_are_not_taken_from_the_client(
    world: World, stage01: Town
) -> None:
    car = world.spawn(CAR, {"number_of_wheels": "7", "role_name": "hero"}, place(stage01))
    assert (car.attributes["number_of_wheels"], car.attributes["role_name"]) == ("4", "hero")


def test_destroyed_actor_is_remembered_across_episodes(stage01: Town) -> None:
    world = World(stage01, episode_id=1)
    world.spawn(CAR, {}, place(stage01))
    car = world.spawn(CAR, {}, place(stage01, 20))
    assert world.destroy(car.actor_id)
    assert not world.destroy(car.actor_id)
    following = World(stage01, episode_id=2, previous=world)
    assert following.live_or_dead(car.actor_id) is car
    with pytest.raises(ActorNotFoundError):
        following.live(car.actor_id)
    with pytest.raises(ActorNotFoundError):
        following.live_or_dead(10_000)


def test_the_picture_on_a_prop_goes_with_the_prop(world: World) -> None:
    half = np.zeros((2, MOST_TEXELS // 4, 3), np.float32)
    for _ in range(3):
        prop = world.spawn("static.prop.box01", {}, Pose())
        picture = PlacedPicture(half, prop.box_center, np.eye(3), prop.box_extent)
        world.objects.apply_pictures({}, {prop.actor_id: picture})
        assert prop.actor_id in world.tick(DELTA_S).state.town_changes.prop_pictures
        world.destroy(prop.actor_id)
    assert world.tick(DELTA_S).state.town_changes.placed_pictures == ()


def test_lights_and_spectator_cannot_be_destroyed(world: World) -> None:
    assert not world.destroy(world.light_ids[0])
    assert not world.destroy(world.spectator.actor_id)


def test_streams_are_never_numbered_twice(stage01: Town) -> None:
    world = World(stage01, episode_id=1)
    first = world.spawn(CAMERA, {}, Pose()).stream_id
    following = World(stage01, episode_id=2, previous=world)
    assert len({world.stream_id, first, following.stream_id}) == 3
    assert following.spawn(CAMERA, {}, Pose()).stream_id > following.stream_id > first


def test_who_stands_at_a_light_that_turns_red_is_away_from_it_for_one_frame(
    world: World, stage01: Town
) -> None:
    light = int(np.flatnonzero(world.lights.state == TrafficLightState.GREEN)[0])
    site = stage01.traffic_lights[light]
    x, y, _ = site.trigger[0].center
    car = world.spawn(CAR, {}, Pose((x, y, 0.2), site.trigger[0].rotation_deg))
    world.control_vehicle(car.actor_id, VehicleControl(hand_brake=True))
    world.lights.set_times(light, green=1.0, yellow=1.0)
    seen = []
    for _ in range(60):
        columns = ticks(world, 1).vehicles
        state = (int(columns.light_id[0]) == world.light_ids[light], int(columns.light_state[0]))
        if state not in seen[-1:]:
            seen.append(state)
    assert seen == [
        (True, TrafficLightState.GREEN),
        (True, TrafficLightState.YELLOW),
        (False, TrafficLightState.GREEN),
        (True, TrafficLightState.RED),
    ]


def test_who_stands_at_a_frozen_red_light_stays_at_it(world: World, stage01: Town) -> None:
    site = stage01.traffic_lights[0]
    x, y, _ = site.trigger[0].center
    world.spawn(CAR, {}, Pose((x, y, 0.2), site.trigger[0].rotation_deg))
    world.lights.freeze_all(True)
    world.lights.set_state(0, TrafficLightState.RED)
    ticks(world, 1)
    for _ in range(5):
        assert ticks(world, 1).vehicles.light_id.tolist() == [world.light_ids[0]]


def test_vehicle_in_a_trigger_has_the_light_and_outside_has_none(
    world: World, stage01: Town
) -> None:
    site = stage01.traffic_lights[0]
    x, y, _ = site.trigger[0].center
    inside = Pose((x, y, 0.2), site.trigger[0].rotation_deg)
    car = world.spawn(CAR, {}, inside)
    world.lights.set_state(0, TrafficLightState.RED)
    columns = ticks(world, 2).vehicles
    assert columns.light_id.tolist() == [world.light_ids[0]]
    assert columns.light_state.tolist() == [TrafficLightState.RED]
    world.set_pose(car.actor_id, Pose((x, y, 100.0)))
    columns = world.tick(DELTA_S).vehicles
    assert columns.light_id.tolist() == [0]
    assert columns.light_state.tolist() == [TrafficLightState.GREEN]


@pytest.mark.parametrize(("beside_lane_m", "is_queued"), [(-1.0, True), (1.6, False)])
def test_who_is_parked_beside_the_lane_does_not_keep_a_light_green(
    world: World, stage01: Town, beside_lane_m: float, is_queued: bool
) -> None:
    green = np.flatnonzero(world.lights.state == TrafficLightState.GREEN).tolist()
    light = next(light for light in green if len(stage01.traffic_lights[light].trigger) == 1)
    box = stage01.traffic_lights[light].trigger[0]
    yaw = np.radians(box.rotation_deg[1] - 90.0)
    lane = world.lanes.nearest(np.array([box.center]))[0]
    aside_m = stage01.lanes.width_m[lane] / 2.0 + beside_lane_m
    x = box.center[0] - 8.0 * np.cos(yaw) - aside_m * np.sin(yaw)
    y = box.center[1] - 8.0 * np.sin(yaw) + aside_m * np.cos(yaw)
    car = world.spawn(CAR, {}, Pose((x, y, 0.2), (0.0, box.rotation_deg[1] - 90.0, 0.0)))
    world.set_simulate_physics(car.actor_id, False)
    for _ in range(24):  # longer than the fixed cycle's green
        world.tick(0.5)
    assert (world.lights.state[light] == TrafficLightState.GREEN) == is_queued


def test_who_is_told_to_let_others_pass_sees_red_and_no_light(world: World, stage01: Town) -> None:
    cars = [world.spawn(CAR, {}, place(stage01, index)) for index in (0, 20)]
    ticks(world, 1)
    world.arm_turns.waiting_ids = np.array([cars[1].actor_id], np.uint32)
    columns = world.freeze(DELTA_S).vehicles
    assert columns.light_id.tolist() == [0, 0]
    assert columns.light_state.tolist() == [TrafficLightState.GREEN, TrafficLightState.RED]


@pytest.mark.parametrize(("sticky", "at_the_end"), [("true", 1.0), ("false", 0.0)])
def test_control_that_is_not_sticky_lasts_for_one_tick(
    world: World, stage01: Town, sticky: str, at_the_end: float
) -> None:
    car = world.spawn(CAR, {"sticky_control": sticky}, place(stage01))
    ticks(world, 2)
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    ticks(world, 1)
    assert world.motion(car).throttle == 1.0
    ticks(world, 1)
    assert world.motion(car).throttle == at_the_end
    # Who sets it each tick drives all the same.
    for _ in range(20):
        world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
        ticks(world, 1)
    assert world.motion(car).speed > 1.0
    world.control_ackermann(car.actor_id, AckermannControl(speed=5.0, acceleration=2.0))
    ticks(world, 40)
    assert world.motion(car).speed > 3.0


def test_speed_limit_is_that_of_the_last_sign_passed(world: World, stage01: Town) -> None:
    lanes = stage01.lanes

    def limit_after_being_at(sample: int) -> float:
        pose = Pose(tuple(lanes.location[sample]), tuple(lanes.rotation_deg[sample]))
        world.set_pose(car.actor_id, pose)
        return float(ticks(world, 1).vehicles.speed_limit_kmh[0])

    signs = {kmh: int(np.flatnonzero(lanes.posted_kmh == kmh)[0]) for kmh in (30.0, 40.0)}
    without = int(np.flatnonzero((lanes.posted_kmh == 0.0) & (lanes.speed_limit_kmh == 40.0))[0])
    car = world.spawn(CAR, {}, place(stage01))
    assert limit_after_being_at(signs[30.0]) == 30.0
    assert limit_after_being_at(without) == 30.0
    assert limit_after_being_at(signs[40.0]) == 40.0
    assert limit_after_being_at(without) == 40.0


def test_who_appears_on_a_signed_road_has_its_limit(world: World, stage01: Town) -> None:
    for index in (0, 20, 40, 60):
        world.spawn(CAR, {}, place(stage01, index))
    state = ticks(world, 1)
    centres = state.state.location[state.vehicles.rows]
    distances = np.linalg.norm(stage01.lanes.location[None] - centres[:, None], axis=2)
    nearest = stage01.lanes.speed_limit_kmh[distances.argmin(axis=1)]
    np.testing.assert_array_equal(state.vehicles.speed_limit_kmh, nearest)


def test_walker_walks_where_its_control_says_and_stands_on_the_ground(
    world: World, stage01: Town
) -> None:
    walker = world.spawn(WALKER, {}, place(stage01))
    world.control_walker(walker.actor_id, WalkerControl((0.0, 2.0, 0.0), 1.5))
    snapshot = ticks(world, 10)
    row = world.actors.row(walker.actor_id)
    x, y, _ = place(stage01).location
    moved = snapshot.state.location[row]
    np.testing.assert_allclose(moved[:2], [x, y + 3.0 * 10 * DELTA_S])
    np.testing.assert_allclose(snapshot.state.velocity[row], [0.0, 3.0, 0.0], atol=1e-9)
    assert snapshot.state.rotation_deg[row, 1] == pytest.approx(90.0)
    assert moved[2] - walker.box_extent[2] == pytest.approx(0.0, abs=1e-6)  # the road's height


@pytest.mark.parametrize("falls_into", [0.0, 0.25])
def test_walker_spawned_at_a_place_of_feet_does_not_fall(
    world: World, stage01: Town, falls_into: float
) -> None:
    """As programs do with ``get_random_location_from_navigation``, which gives no origin."""
    x, y, _ = place(stage01).location
    walker = world.spawn(WALKER, {}, Pose((x, y, 0.15 - falls_into)))
    assert walker.box_extent[2] > 0.8  # its feet would be below what a foot can step up
    snapshot = ticks(world, 40)
    row = world.actors.row(walker.actor_id)
    assert snapshot.state.location[row, 2] == pytest.approx(walker.box_extent[2], abs=1e-6)


def test_walker_spawned_below_the_ground_falls(world: World, stage01: Town) -> None:
    x, y, _ = place(stage01).location
    walker = world.spawn(WALKER, {}, Pose((x, y, -3.0)))
    snapshot = ticks(world, 40)
    assert snapshot.state.location[world.actors.row(walker.actor_id), 2] < -5.0


def test_walker_placed_by_navigation_has_its_feet_there(world: World, stage01: Town) -> None:
    walker = world.spawn(WALKER, {}, place(stage01))
    world.set_simulate_physics(walker.actor_id, False)
    x, y, _ = place(stage01).location
    for step in range(3):
        world.place_walker(walker.actor_id, Pose((x + 0.07 * step, y, 0.15)), 1.4)
        snapshot = world.tick(DELTA_S)
    row = world.actors.row(walker.actor_id)
    assert snapshot.state.location[row, 2] == pytest.approx(0.15 + walker.box_extent[2])
    assert snapshot.state.velocity[row, 0] == pytest.approx(1.4)
    assert snapshot.walkers.speed.tolist() == pytest.approx([1.4])


def test_walker_that_is_placed_far_away_did_not_walk_there(world: World, stage01: Town) -> None:
    walker = world.spawn(WALKER, {}, place(stage01))
    ticks(world, 2)
    world.set_pose(walker.actor_id, place(stage01, 20))
    snapshot = world.tick(DELTA_S)
    row = world.actors.row(walker.actor_id)
    assert np.abs(snapshot.state.velocity[row]).max() < 1e-6


def test_ackermann_control_reaches_its_speed_and_stops(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    world.control_ackermann(car.actor_id, AckermannControl(speed=6.0))
    ticks(world, 200)
    assert world.motion(car).speed == pytest.approx(6.0, abs=0.3)
    world.control_ackermann(car.actor_id, AckermannControl(speed=0.0))
    ticks(world, 300)
    assert world.motion(car).speed == pytest.approx(0.0, abs=0.1)


def test_ackermann_control_stops_before_it_goes_the_other_way(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    for wanted in (6.0, -3.0, 6.0):
        world.control_ackermann(car.actor_id, AckermannControl(speed=wanted))
        for _ in range(220):
            world.tick(DELTA_S)
            speed, gear = world.motion(car).speed, world.motion(car).gear
            if abs(speed) > 1.0:
                assert (gear < 0) == (speed < 0.0)
        assert speed == pytest.approx(wanted, abs=0.3)


def test_ackermann_control_holds_the_wheel_straight_where_no_wheel_steers(
    world: World, stage01: Town
) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    physics = world.parameters(car)
    wheels = tuple(replace(wheel, max_steer_angle_deg=0.0) for wheel in physics.wheels)
    world.set_parameters(car.actor_id, replace(physics, wheels=wheels))
    world.control_ackermann(car.actor_id, AckermannControl(steer_rad=0.3, speed=6.0))
    ticks(world, 100)
    assert world.motion(car).steer == 0.0
    assert world.motion(car).speed > 3.0


@pytest.mark.parametrize(
    ("settings", "delta_s", "expected"),
    [
        (EpisodeSettings(), 0.05, 5),
        (EpisodeSettings(), 0.1, 10),
        (EpisodeSettings(), 0.5, 10),
        (EpisodeSettings(max_substep_delta_time=0.02), 0.05, 3),
        (EpisodeSettings(substepping=False), 0.05, 1),
    ],
)
def test_substeps_are_as_long_as_allowed(
    settings: EpisodeSettings, delta_s: float, expected: int
) -> None:
    assert settings.physics(delta_s).substeps == expected


def test_a_killed_walker_lies_for_ten_seconds_and_goes(world: World) -> None:
    walker = world.spawn(WALKER, {}, Pose((0.0, 0.0, 1.0)))
    world.control_walker(walker.actor_id, WalkerControl((1.0, 0.0, 0.0), 2.0))
    world.kill_walker(walker.actor_id)
    world.tick(5.0)
    lies = world.actors.pose(walker.actor_id).location
    world.kill_walker(walker.actor_id)  # killing it again gives it no more time
    world.tick(4.9)
    assert world.actors.pose(walker.actor_id).location == lies
    world.tick(0.1)
    assert walker.actor_id not in world.actors


def test_a_killed_walker_is_moved_no_more(world: World) -> None:
    walker = world.spawn(WALKER, {}, Pose((0.0, 0.0, 1.0))).actor_id
    ticks(world, 2)
    lies = world.actors.pose(walker).location
    world.kill_walker(walker)
    world.control_walker(walker, WalkerControl((1.0, 0.0, 0.0), 1.5))
    with pytest.raises(ActorError, match=f"Walker is already dead. Actor Id: {walker}"):
        world.place_walker(walker, Pose((5.0, 5.0, 0.0)), 1.4)
    snapshot = ticks(world, 5)
    assert world.actors.pose(walker).location == lies
    assert snapshot.walkers.speed.tolist() == [0.0]


@pytest.mark.parametrize(
    ("given", "reported"),
    [
        ((0.0, 270.0, 0.0), (0.0, -90.0, 0.0)),
        ((0.0, -450.0, 350.0), (0.0, -90.0, -10.0)),
        ((100.0, 30.0, 0.0), (80.0, -150.0, 180.0)),
        ((-190.0, 0.0, 20.0), (10.0, 180.0, -160.0)),
        ((-30.0, 180.0, -180.0), (-30.0, 180.0, -180.0)),
    ],
)
def test_rotations_are_reported_within_half_a_turn(
    world: World, given: Vector3, reported: Vector3
) -> None:
    pose = Pose((0.0, 0.0, 1.0), given)
    spawned = world.spawn("static.prop.trafficcone01", {}, pose)
    moved = [world.spawn("static.prop.trafficcone01", {}, Pose()), world.spectator]
    for actor in moved:
        world.set_pose(actor.actor_id, pose)
    for actor in (spawned, *moved):
        found = world.actors.pose(actor.actor_id)
        assert found.rotation_deg == pytest.approx(reported)
        np.testing.assert_allclose(pose_matrix(*found), pose_matrix(*pose), atol=1e-12)


def test_a_vehicle_reports_its_yaw_alike_before_and_after_it_turns(
    world: World, stage01: Town
) -> None:
    location, (pitch, yaw, roll) = place(stage01)
    car = world.spawn(CAR, {}, Pose(location, (pitch, yaw + 360.0, roll)))
    world.control_vehicle(car.actor_id, VehicleControl(throttle=0.5, steer=0.1))
    yaws = [ticks(world, 1).state.rotation_deg[world.actors.row(car.actor_id), 1] for _ in range(9)]
    assert np.abs(np.diff(yaws)).max() < 1.0


def test_only_walkers_can_be_killed(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01, 0))
    with pytest.raises(ActorTypeError):
        world.kill_walker(car.actor_id)


@pytest.mark.parametrize("type_id", ["util.actor.empty", "static.prop.mesh"])
def test_what_has_no_shape_carries_sensors_and_stops_nobody(
    world: World, stage01: Town, type_id: str
) -> None:
    x, y, z, _, yaw, _ = stage01.spawn_points[0].tolist()
    way = np.radians(yaw)
    ahead = Pose((x + 8.0 * np.cos(way), y + 8.0 * np.sin(way), z), (0.0, yaw, 0.0))
    mount = world.spawn(type_id, {}, ahead)
    camera = world.spawn(CAMERA, {}, Pose((1.0, 0.0, 2.0)), parent_id=mount.actor_id)
    assert world.actors.pose(camera.actor_id).location == pytest.approx(
        (x + 9.0 * np.cos(way), y + 9.0 * np.sin(way), z + 2.0), abs=1e-5
    )
    car = world.spawn(CAR, {}, place(stage01))
    world.control_vehicle(car.actor_id, VehicleControl(throttle=1.0))
    ticks(world, 60)
    driven = np.subtract(world.actors.pose(car.actor_id).location, (x, y, z))
    assert np.hypot(driven[0], driven[1]) > 10.0


def test_the_hero_is_the_first_actor_with_such_a_role(world: World, stage01: Town) -> None:
    roles = ("autopilot", "my_Hero", "ego_vehicle")
    cars = [
        world.spawn(CAR, {"role_name": role}, place(stage01, number))
        for number, role in enumerate(roles)
    ]
    assert ticks(world, 1).state.hero_id == cars[1].actor_id
    world.destroy(cars[1].actor_id)
    assert ticks(world, 1).state.hero_id == cars[2].actor_id
    world.destroy(cars[2].actor_id)
    assert ticks(world, 1).state.hero_id == 0
