"""Riding on others: rigidly, on spring arms, on bones."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.geometry import pose_matrix
from carstage_sim.maps import Town
from carstage_sim.mesh import Material, TriangleMesh, build_mesh
from carstage_sim.world.arm_probe import ArmProbe
from carstage_sim.world.controls import VehicleControl, WalkerControl
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.pose import Pose, compose
from carstage_sim.world.spring_arm import Attachment, AttachmentType, SpringArm
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
WALKER = "walker.pedestrian.0001"
CAMERA = "sensor.camera.rgb"
DELTA_S = 0.05
GHOST = Attachment(AttachmentType.SPRING_ARM_GHOST)
ARM = Attachment(AttachmentType.SPRING_ARM)


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def world(stage01: Town, earlier: World) -> World:
    return World(stage01, episode_id=1, previous=earlier)


def place(town: Town, index: int = 0) -> Pose:
    x, y, z, pitch, yaw, roll = town.spawn_points[index].tolist()
    return Pose((x, y, z), (pitch, yaw, roll))


def in_frame(world: World, parent_id: int, child_id: int) -> Pose:
    """The child's pose in its parent's frame."""
    parent, child = world.actors.pose(parent_id), world.actors.pose(child_id)
    matrix = np.linalg.inv(pose_matrix(parent.location, parent.rotation_deg)) @ pose_matrix(
        child.location, child.rotation_deg
    )
    x, y, z = matrix[:3, 3].tolist()
    return Pose((x, y, z))


def ticks(world: World, count: int) -> None:
    for _ in range(count):
        world.tick(DELTA_S, 5)


def test_riders_on_riders_follow_the_first_parent(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    mount = Pose((1.0, 0.5, 2.0), (0.0, 30.0, 0.0))
    prop = world.spawn("static.prop.trafficcone01", {}, mount, parent_id=car).actor_id
    camera = world.spawn(CAMERA, {}, mount, parent_id=prop).actor_id
    world.control_vehicle(car, VehicleControl(throttle=0.8, steer=0.4))
    ticks(world, 40)
    expected = compose(compose(world.actors.pose(car), mount), mount)
    found = world.actors.pose(camera)
    np.testing.assert_allclose(found.location, expected.location, atol=1e-6)
    np.testing.assert_allclose(found.rotation_deg, expected.rotation_deg, atol=1e-6)


def test_what_a_car_carries_does_not_push_it(world: World, stage01: Town) -> None:
    """A board follows a tick later: a car that brakes, or drives back, would run into it."""
    places = []
    for carries in (False, True):
        car = world.spawn(CAR, {}, place(stage01)).actor_id
        boards = []
        if carries:
            for ahead_m in (-2.45, 2.45):
                mount = Pose((ahead_m, 0.0, 0.7))
                boards.append(world.spawn("static.prop.ironplank", {}, mount, parent_id=car))
        for throttle, brake in ((1.0, 0.0), (0.0, 1.0)):
            world.control_vehicle(car, VehicleControl(throttle=throttle, brake=brake))
            ticks(world, 30)
        places.append(world.actors.pose(car).location)
        for one in [*boards, world.live(car)]:
            world.destroy(one.actor_id)
    np.testing.assert_allclose(places[1], places[0], atol=1e-9)


def test_what_rode_on_a_destroyed_actor_stays_where_it_was(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    for kind in (Attachment(), ARM, GHOST, Attachment(socket="Wheel_Front_Left")):
        camera = world.spawn(CAMERA, {}, Pose((-4.0, 0.0, 2.0)), parent_id=car, attachment=kind)
    world.control_vehicle(car, VehicleControl(throttle=0.8))
    ticks(world, 20)
    before = world.actors.pose(camera.actor_id)
    world.destroy(car)
    ticks(world, 5)
    assert world.actors.pose(camera.actor_id) == before


def test_what_rode_on_a_destroyed_actor_does_not_ride_on_the_next_one_of_that_id(
    world: World, stage01: Town
) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    camera = world.spawn(CAMERA, {}, Pose((-4.0, 0.0, 2.0)), parent_id=car)
    ticks(world, 2)
    before = world.actors.pose(camera.actor_id)
    world.destroy(car)
    assert world.spawn(CAR, {}, place(stage01, 6), wanted_id=car).actor_id == car
    ticks(world, 2)
    assert world.actors.pose(camera.actor_id) == before
    world.set_pose(camera.actor_id, Pose((1.0, 2.0, 3.0)))
    assert world.actors.pose(camera.actor_id).location == (1.0, 2.0, 3.0)


def test_set_pose_of_a_rider_is_in_its_parents_frame(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    camera = world.spawn(CAMERA, {}, Pose((1.0, 0.0, 2.0)), parent_id=car).actor_id
    world.set_pose(camera, Pose((0.0, 0.0, 5.0)))
    ticks(world, 1)
    np.testing.assert_allclose(in_frame(world, car, camera).location, (0.0, 0.0, 5.0), atol=1e-6)


def test_ghost_arm_holds_its_place_behind_a_standing_parent_and_looks_along_itself(
    world: World, stage01: Town
) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    camera = world.spawn(
        CAMERA, {}, Pose((-4.0, 0.0, 3.0), (8.0, 0.0, 0.0)), parent_id=car, attachment=GHOST
    ).actor_id
    ticks(world, 30)
    car_pose, pose = world.actors.pose(car), world.actors.pose(camera)
    np.testing.assert_allclose(np.subtract(pose.location, car_pose.location)[2], 3.0, atol=0.02)
    # The arm looks down by atan(3 / 4), the script's 8 degrees are added.
    assert pose.rotation_deg[0] == pytest.approx(-36.87 + 8.0, abs=0.1)
    assert pose.rotation_deg[1] == pytest.approx(car_pose.rotation_deg[1], abs=0.1)
    assert pose.rotation_deg[2] == pytest.approx(0.0, abs=0.1)


def test_arm_turns_after_its_parent_with_a_lag() -> None:
    arm = SpringArm((-5.0, 0.0, 0.0), ghost=True)
    arm.follow(pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), DELTA_S, None)
    turned = pose_matrix((0.0, 0.0, 0.0), (0.0, 90.0, 0.0))
    yaws = []
    for _ in range(40):
        arm.follow(turned, DELTA_S, None)
        assert arm.yaw_deg is not None
        yaws.append(arm.yaw_deg)
    assert 10.0 < yaws[0] < 45.0
    assert yaws == sorted(yaws)
    assert yaws[-1] == pytest.approx(90.0, abs=0.1)


def test_lag_goes_in_steps_of_a_sixtieth_towards_a_moving_target() -> None:
    arm = SpringArm((-5.0, 0.0, 0.0), ghost=True, yaw_deg=0.0)
    arm.follow(pose_matrix((0.0, 0.0, 0.0), (0.0, 90.0, 0.0)), 0.05, None)
    share, yaw = 8.0 / 60.0, 0.0
    for target in (30.0, 60.0, 90.0):
        yaw += (target - yaw) * share
    assert arm.yaw_deg == pytest.approx(yaw)


def test_arm_stays_level_while_its_parent_rolls_and_pitches() -> None:
    arm = SpringArm((-5.0, 0.0, 2.0), ghost=True)
    tilted = arm.follow(pose_matrix((0.0, 0.0, 0.0), (20.0, 0.0, 15.0)), DELTA_S, None)
    assert tilted[2, 3] == pytest.approx(2.0, abs=1e-9)
    assert tilted[2, 1] == pytest.approx(0.0, abs=1e-9)  # its right is level


def wall(x: float) -> TriangleMesh:
    corners = np.array([[x, -5, -5], [x, 5, -5], [x, 5, 5], [x, -5, 5]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return build_mesh(
        corners, triangles, np.full(2, Material.ASPHALT, np.uint8), np.ones(2, np.uint8)
    )


def test_arm_is_shortened_before_a_wall_but_a_ghost_goes_through() -> None:
    origin = pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    probe = ArmProbe(wall(-3.0))
    held = SpringArm((-5.0, 0.0, 0.0), ghost=False).follow(origin, DELTA_S, probe)
    free = SpringArm((-5.0, 0.0, 0.0), ghost=True).follow(origin, DELTA_S, probe)
    assert held[0, 3] == pytest.approx(-2.88)
    assert free[0, 3] == pytest.approx(-5.0)
    assert ArmProbe(wall(-9.0))((0.0, 0.0, 0.0), (-5.0, 0.0, 0.0)) is None


def test_sockets_of_vehicles_are_its_wheels(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01))
    assert car.blueprint is not None
    assert car.blueprint.vehicle is not None
    hub = car.blueprint.vehicle.wheels[0].position_m
    on_wheel = Attachment(socket="Wheel_Front_Left")
    camera = world.spawn(
        CAMERA, {}, Pose((0.0, -1.0, 0.0)), parent_id=car.actor_id, attachment=on_wheel
    )
    ticks(world, 2)
    expected = np.add(hub, (0.0, -1.0, 0.0))
    np.testing.assert_allclose(
        in_frame(world, car.actor_id, camera.actor_id).location, expected, atol=1e-6
    )


def test_rider_on_a_hand_moves_with_the_walk(world: World, stage01: Town) -> None:
    x, y, z = place(stage01).location
    walker = world.spawn(WALKER, {}, Pose((x, y, z + 1.0)))
    on_hand = Attachment(socket="crl_hand__R")
    camera = world.spawn(CAMERA, {}, Pose(), parent_id=walker.actor_id, attachment=on_hand).actor_id
    world.control_walker(walker.actor_id, WalkerControl((1.0, 0.0, 0.0), 1.4))
    ahead = []
    for _ in range(30):
        ticks(world, 1)
        ahead.append(in_frame(world, walker.actor_id, camera).location[0])
    assert max(ahead) - min(ahead) > 0.1


def test_unknown_socket_is_refused(world: World, stage01: Town) -> None:
    car = world.spawn(CAR, {}, place(stage01)).actor_id
    with pytest.raises(SpawnError, match="no bone 'tail'"):
        world.spawn(CAMERA, {}, Pose(), parent_id=car, attachment=Attachment(socket="tail"))
