"""Wheels near a sensor steer and turn, belong to their vehicle, and stay in its box."""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.actors import ActorModels, drift_of
from carstage_sim.sensors.loose_wheels import BODY, NEAR_M, WHEEL
from carstage_sim.sensors.sweeping_lidar import _Scenes
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

CAR = 7
PLACE = (4.0, -1.0, 0.0)
YAW_DEG = 30.0
VEHICLES = [b for b in catalogue().values() if b.kind == ActorKind.VEHICLE]
SIDE = MappingProxyType({"location": (0.0, 6.0, 0.5), "rotation_deg": (0.0, -90.0, 0.0)})
LENS = MappingProxyType({"image_size_x": 400, "image_size_y": 120, "fov": 60.0})


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.getbasetemp() / "trees"
    ) as built:
        yield built


def near(number=1, place=PLACE, yaw_deg=YAW_DEG, **more):
    """A car with a sensor nearby."""
    sensor = (100, (0.0, 0.0, 2.0), 0.0)
    return state(number, vehicles=[(CAR, place, yaw_deg)], sensors=[sensor], **more)


def on_vehicle(frame, row):
    """Rotation of a row as seen from its vehicle."""
    return frame.rotation[0].T @ frame.rotation[row]


def test_front_wheels_follow_the_steering_and_rear_wheels_do_not(sensors):
    for steer_deg, shown_deg in ((17.5, 17.5), (-30.0, -30.0), (70.0, 40.0)):
        frame = sensors.frame_of(near(steer_deg=steer_deg))
        assert frame.actor_id.tolist() == [CAR] * 5
        for row in (1, 2):
            turned = rotation_matrix((0.0, shown_deg, 0.0))
            assert np.allclose(on_vehicle(frame, row), turned, atol=1e-6)
        for row in (3, 4):
            assert np.allclose(on_vehicle(frame, row), np.eye(3), atol=1e-6)


def corners_in_world(frame, row):
    return frame.shapes[row].corners.reshape(-1, 3) @ frame.rotation[row].T + frame.location[row]


def test_a_wheel_rolls_on_the_ground_with_the_way_of_its_vehicle(sensors):
    way = 0.01
    ahead = rotation_matrix((0.0, YAW_DEG, 0.0))[:, 0]
    before = sensors.frame_of(near(rolled_m=3.0))
    after = sensors.frame_of(near(place=tuple(PLACE + way * ahead), rolled_m=3.0 + way))
    for row in range(1, 5):
        was, moved = corners_in_world(before, row), corners_in_world(after, row)
        along = (moved - was) @ ahead
        touching, top = was[:, 2] < 0.005, was[:, 2] > was[:, 2].max() - 0.005
        assert touching.any()
        assert abs(along[touching]).max() < 0.05 * way
        assert along[top].min() > 1.95 * way


def test_wheels_are_made_where_they_stand_on_the_whole_vehicle(sensors):
    apart, whole = sensors.frame_of(near()), sensors.frame_of(state(vehicles=[(CAR, PLACE, 30.0)]))
    assert len(whole.actor_id) == 1
    corners = np.concatenate([corners_in_world(apart, row) for row in range(5)])
    expected = corners_in_world(whole, 0)
    assert len(corners) == len(expected)
    order, wanted = np.lexsort(corners.T.round(4)), np.lexsort(expected.T.round(4))
    assert np.allclose(corners[order], expected[wanted], atol=1e-3)
    assert np.array_equal(apart.bounds[0], whole.bounds[0])


def test_wheels_far_from_sensors_and_behind_open_doors_are_part_of_the_body(sensors):
    far = near(place=(NEAR_M + 0.1, 0.0, 0.0))
    assert len(sensors.frame_of(far).actor_id) == 1
    assert len(sensors.frame_of(near(place=(NEAR_M - 2.1, 0.0, 0.0))).actor_id) == 5
    opened = near()
    object.__setattr__(opened, "doors", np.array([1, 0], np.uint8))
    assert len(sensors.frame_of(opened).actor_id) == 1


def test_a_wheel_has_ids_and_tags_of_its_vehicle(sensors):
    kinds = ("semantic_segmentation", "instance_segmentation")
    shown = []
    for world in (near(yaw_deg=0.0), state(vehicles=[(CAR, PLACE, 0.0)])):
        asked = [request(f"camera.{kind}", k, **SIDE, **LENS) for k, kind in enumerate(kinds)]
        shown.append([frame.pixels.astype(int) for _, frame in sensors.capture(world, asked)])
    for apart, whole in zip(*shown, strict=True):
        assert (apart != whole).any(axis=-1).mean() < 1e-3
    codes = shown[0][1]
    car = codes[..., 1] + 256 * codes[..., 0] == CAR
    assert car.sum() > 5000
    assert set(codes[car, 2].tolist()) == {int(CityObjectLabel.CAR)}


def test_flow_of_a_wheel_is_that_of_rolling(sensors):
    way = 0.04
    asked = [
        request("camera.optical_flow", 1, **SIDE, **LENS),
        request("camera.depth", 2, **SIDE, **LENS),
    ]
    sensors.reset()
    sensors.capture(near(1, yaw_deg=0.0, rolled_m=1.0), asked)
    moved = near(2, place=(PLACE[0] + way, *PLACE[1:]), yaw_deg=0.0, rolled_m=1.0 + way)
    (_, flow), (_, depth) = sensors.capture(moved, asked)
    frame = sensors.frame_of(moved)
    b, g, r = (depth.pixels[..., k].astype(float) for k in range(3))
    away = (r + 256 * g + 65536 * b) * 1000 / (2**24 - 1)
    across, down = np.meshgrid((np.arange(400) - 199.5) / 200, (np.arange(120) - 59.5) / 200)
    reach = math.tan(math.radians(30.0))
    x, z = across * reach * away, 0.5 - down * reach * away
    # How fast the surface moves along the road, in ways of the car.
    ways = flow.flow[..., 0] * reach * away / way
    rear = corners_in_world(frame, 4)
    low, high = rear.min(axis=0), rear.max(axis=0)
    hub, radius = (low + high) / 2, (high[2] - low[2]) / 2
    rim = (np.hypot(x - hub[0], z - hub[2]) < 0.9 * radius) & (abs(away - 6.0 + high[1]) < 0.15)
    assert rim.sum() > 300
    expected = 1.0 + (z[rim] - hub[2]) / radius
    assert abs(ways[rim] - expected).max() < 0.1
    assert ways[rim].max() > 1.7
    assert ways[rim].min() < 0.3


def test_a_wheel_that_was_part_of_the_body_moved_with_it(sensors):
    asked = [request("camera.optical_flow", 1, **SIDE, **LENS)]
    sensors.reset()
    sensors.capture(state(1, vehicles=[(CAR, (4.0, -1.0, 0.0), 0.0)]), asked)
    ((_, apart),) = sensors.capture(near(2, place=(4.1, -1.0, 0.0), yaw_deg=0.0), asked)
    sensors.reset()
    sensors.capture(state(1, vehicles=[(CAR, (4.0, -1.0, 0.0), 0.0)]), asked)
    ((_, whole),) = sensors.capture(state(2, vehicles=[(CAR, (4.1, -1.0, 0.0), 0.0)]), asked)
    assert np.abs(whole.flow).max() > 0.01
    assert (np.abs(apart.flow - whole.flow).max(axis=-1) > 1e-4).mean() < 1e-3


@pytest.mark.parametrize("blueprint", VEHICLES, ids=lambda b: b.id)
def test_no_steered_wheel_leaves_the_box_or_the_ground(blueprint, tmp_path):
    models = ActorModels(town(GROUND), cache=tmp_path)
    center, extent = np.array(blueprint.box_center), np.array(blueprint.box_extent)
    whole = models.mesh(blueprint.id)
    parts = [models.mesh(f"{blueprint.id}{BODY}")]
    world = near(place=(0.0, 0.0, 0.0), yaw_deg=0.0)
    object.__setattr__(world, "type_id", (blueprint.id, "sensor.camera.rgb"))
    for steer_deg in (-70.0, -20.0, 0.0, 35.0, 70.0):
        world.wheel_angle_deg[:] = steer_deg
        world.rolled_m[:] = 0.37 * steer_deg
        _, *wheels = models.placements(world)
        assert len(wheels) == int(blueprint.attribute("number_of_wheels").value)
        for number, wheel in enumerate(wheels):
            assert wheel.model == f"{blueprint.id}{WHEEL}{number}"
            mesh = models.mesh(wheel.model)
            points = mesh.vertices @ wheel.rotation.T + wheel.location
            assert np.all(points[:, :2] > (center - extent)[:2] - 0.01)
            assert np.all(points < center + extent + 0.01)
            assert points[:, 2].min() > -0.001
            assert points[:, 2].min() < 0.01, "a wheel stands on the ground"
    parts += [models.mesh(wheel.model) for wheel in wheels]
    assert sum(len(part.triangles) for part in parts) == len(whole.triangles)


def test_a_two_wheelers_wheels_turn_and_do_not_steer(sensors):
    world = near(steer_deg=30.0, rolled_m=0.2)
    object.__setattr__(world, "type_id", ("vehicle.bh.crossbike", "sensor.camera.rgb"))
    frame = sensors.frame_of(world)
    assert len(frame.actor_id) == 3
    for row in (1, 2):
        turn = on_vehicle(frame, row)
        assert np.allclose(turn[:, 1], (0.0, 1.0, 0.0))
        assert turn[0, 2] > 0.3


def test_a_sensor_within_its_carriers_box_sees_nothing_of_it(sensors):
    inside = {"location": (4.0, -1.0, 0.3), "owner_id": CAR}
    for yaw_deg in (0.0, 90.0, 180.0, 270.0):
        asked = request("camera.instance_segmentation", 1, rotation_deg=(-10.0, yaw_deg, 0.0),
                        **inside, **LENS)  # fmt: skip
        ((_, frame),) = sensors.capture(near(), [asked])
        codes = frame.pixels.astype(int)
        assert not (codes[..., 1] + 256 * codes[..., 0] == CAR).any()


def test_an_obstacle_detector_does_not_meet_wheels_of_its_carrier(sensors):
    for dynamic in ("true", "false"):
        asked = request("other.obstacle", 1, location=(1.0, -2.3, 0.4), owner_id=CAR,
                        rotation_deg=(0.0, YAW_DEG, 0.0), distance=4, hit_radius=0.1,
                        only_dynamics=dynamic)  # fmt: skip
        assert sensors.capture(near(), [asked]) == []


def test_wheels_drift_with_their_vehicle_and_not_about_themselves(sensors):
    world = near(velocity=(3.0, 1.0, 0.0), angular_velocity_deg=(0.0, 0.0, 40.0), steer_deg=20.0)
    frame = sensors.frame_of(world)
    drift = drift_of(world, frame)
    seconds = 1e-4
    for row in range(1, 5):
        turned = rotation_matrix((0.0, 40.0 * seconds, 0.0))
        offset = frame.location[row] - frame.location[0]
        moved = frame.location[0] + np.array((3.0, 1.0, 0.0)) * seconds + turned @ offset
        assert np.allclose(frame.location[row] + drift.velocity[row] * seconds, moved, atol=1e-7)


def test_wheels_go_along_with_their_vehicle_in_a_sweep(sensors):
    before = near(1, place=(2.0, -2.0, 0.0), yaw_deg=10.0)
    now = near(2, steer_deg=25.0, rolled_m=0.5)
    frame = sensors.frame_of(now)
    scene = _Scenes(frame, before, now, 0.1)._at(1.0)
    assert np.allclose(scene.position[0], (2.0, -2.0, 0.0), atol=1e-5)
    for row in range(1, 5):
        was = scene.rotation[0].T @ (scene.position[row] - scene.position[0])
        assert np.allclose(was, frame.rotation[0].T @ (frame.location[row] - frame.location[0]),
                           atol=1e-5)  # fmt: skip
        assert np.allclose(scene.rotation[0].T @ scene.rotation[row], on_vehicle(frame, row),
                           atol=1e-5)  # fmt: skip
