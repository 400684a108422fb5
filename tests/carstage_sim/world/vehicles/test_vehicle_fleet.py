"""The fleet's motion, as a client would judge it from snapshots."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles.fleet import VehicleFleet
from carstage_sim.world.vehicles.parameters import VehicleParameters

DELTA_S = 0.05
SUBSTEPS = 5


def parameters(type_id: str = "vehicle.tesla.model3") -> VehicleParameters:
    found = catalogue()[type_id].vehicle
    assert found is not None
    return found


def fleet_of_one(type_id: str = "vehicle.tesla.model3", yaw_deg: float = 0.0) -> VehicleFleet:
    fleet = VehicleFleet()
    fleet.add(7, parameters(type_id), (10.0, -4.0, 0.0), (0.0, yaw_deg, 0.0))
    fleet.step(DELTA_S, SUBSTEPS)  # settles on the ground
    return fleet


def drive(
    fleet: VehicleFleet,
    seconds: float,
    *,
    throttle: float = 0.0,
    steer: float = 0.0,
    brake: float = 0.0,
    hand_brake: bool = False,
    reverse: bool = False,
) -> None:
    fleet.set_control(7, VehicleControl(throttle, steer, brake, hand_brake, reverse))
    for _ in range(round(seconds / DELTA_S)):
        fleet.step(DELTA_S, SUBSTEPS)


def forward_speed(fleet: VehicleFleet) -> float:
    yaw = math.radians(fleet.rotation_deg[0, 1])
    return float(fleet.velocity[0, :2] @ (math.cos(yaw), math.sin(yaw)))


pedals = st.tuples(
    st.floats(0.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.booleans(), st.booleans()
)


@settings(max_examples=25, deadline=None)
@given(st.lists(pedals, min_size=3, max_size=25), st.sampled_from([0.01, 0.05, 0.1]))
def test_velocity_is_displacement_and_acceleration_is_change_of_velocity(
    commands: list[tuple[float, float, float, bool, bool]], delta_s: float
) -> None:
    fleet = fleet_of_one()
    for throttle, steer, brake, hand_brake, reverse in commands:
        fleet.set_control(7, VehicleControl(throttle, steer, brake, hand_brake, reverse))
        location, velocity = fleet.location.copy(), fleet.velocity.copy()
        fleet.step(delta_s, SUBSTEPS)
        np.testing.assert_allclose(fleet.velocity, (fleet.location - location) / delta_s)
        np.testing.assert_allclose(fleet.acceleration, (fleet.velocity - velocity) / delta_s)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-8.0, 20.0),
    st.floats(0.05, 1.0),
    st.floats(-1.0, 1.0),
    st.sampled_from(
        ["vehicle.tesla.model3", "vehicle.mitsubishi.fusorosa", "vehicle.bh.crossbike"]
    ),
)
def test_brake_never_reverses_and_holds_at_rest(
    speed: float, brake: float, steer: float, type_id: str
) -> None:
    fleet = fleet_of_one(type_id)
    fleet.set_target_velocity(7, (speed, 0.0, 0.0))
    fleet.set_control(7, VehicleControl(0.0, steer, brake, False, False))
    for _ in range(40):
        fleet.step(0.1, 3)
        rolled = forward_speed(fleet)
        assert rolled * math.copysign(1.0, speed) >= -1e-9
    if brake > 0.9:
        at_rest = fleet.location.copy()
        fleet.step(0.1, 3)
        np.testing.assert_array_equal(fleet.location, at_rest)


def test_full_brake_stops_from_50_km_h_within_14_metres() -> None:
    fleet = fleet_of_one()
    fleet.set_target_velocity(7, (50 / 3.6, 0.0, 0.0))
    start_x = fleet.location[0, 0]
    drive(fleet, 3.0, brake=1.0)
    assert fleet.velocity[0, 0] == 0.0
    assert 9.0 < fleet.location[0, 0] - start_x < 14.0


def test_traffic_managers_strongest_pedals_accelerate_and_brake_as_it_expects() -> None:
    fleet = fleet_of_one()
    drive(fleet, 2.0, throttle=0.85)
    assert 3.0 < fleet.velocity[0, 0] / 2.0 < 4.2
    drive(fleet, 0.15, brake=0.7)  # until the pedal is down
    before = fleet.velocity[0, 0]
    drive(fleet, 0.5, brake=0.7)
    assert before - fleet.velocity[0, 0] >= 0.5 * 6.0


def test_wheels_roll_with_the_way_forwards_and_back_and_not_with_a_jump() -> None:
    fleet = fleet_of_one(yaw_deg=30.0)
    start = fleet.location.copy()
    drive(fleet, 3.0, throttle=0.5)
    way = float(np.linalg.norm(fleet.location - start))
    assert way > 3.0
    assert float(fleet.rolled_m[0]) == pytest.approx(way, rel=1e-3)
    drive(fleet, 4.0, brake=1.0)
    forwards = float(fleet.rolled_m[0])
    drive(fleet, 3.0, throttle=0.5, reverse=True)
    assert float(fleet.rolled_m[0]) < forwards - 1.0
    drive(fleet, 4.0, brake=1.0)
    stands = float(fleet.rolled_m[0])
    fleet.set_simulate_physics(7, False)
    fleet.set_transform(7, (500.0, 0.0, 0.0), (0.0, 30.0, 0.0))
    fleet.step(DELTA_S, SUBSTEPS)
    assert float(fleet.rolled_m[0]) == stands
    fleet.set_transform(7, (500.5, 0.0, 0.0), (0.0, 0.0, 0.0))
    fleet.step(DELTA_S, SUBSTEPS)
    assert float(fleet.rolled_m[0]) == pytest.approx(stands + 0.5)


def test_pedals_and_wheel_take_their_time() -> None:
    fleet = fleet_of_one()
    drive(fleet, 0.1, throttle=1.0, steer=1.0)
    assert float(fleet.wheel_angle_deg[0]) == pytest.approx(0.25 * 70.0, rel=0.01)
    soon = float(fleet.acceleration[0, 0])
    drive(fleet, 0.2, throttle=1.0)
    assert 0.2 < soon / float(fleet.acceleration[0, 0]) < 0.7
    drive(fleet, 0.1)
    assert float(fleet.wheel_angle_deg[0]) == 0.0
    drive(fleet, 0.1)
    assert float(fleet.acceleration[0, 0]) < 0.0


def test_a_car_turns_in_gradually_and_stops_turning_when_it_stops() -> None:
    fleet = fleet_of_one()
    fleet.set_target_velocity(7, (15.0, 0.0, 0.0))
    rates = []
    for _ in range(8):
        drive(fleet, DELTA_S, throttle=0.3, steer=0.1)
        rates.append(float(fleet.angular_velocity_deg[0, 2]))
    changes = np.diff(rates)
    assert (changes > 0.0).all()
    assert changes.max() < 0.4 * rates[-1]
    drive(fleet, 4.0, steer=0.1, brake=1.0)
    assert float(fleet.angular_velocity_deg[0, 2]) == 0.0


def test_released_pedals_coast_to_a_stop_gently() -> None:
    fleet = fleet_of_one()
    fleet.set_target_velocity(7, (10.0, 0.0, 0.0))
    drive(fleet, 1.0)
    assert 9.4 < fleet.velocity[0, 0] < 9.9
    drive(fleet, 60.0)
    assert fleet.velocity[0, 0] == 0.0


def test_reverse_drives_backwards_at_a_bounded_speed() -> None:
    fleet = fleet_of_one()
    drive(fleet, 10.0, throttle=1.0, reverse=True)
    assert -9.0 < fleet.velocity[0, 0] < -6.0
    assert fleet.gear[0] == -1


def test_a_reverse_gear_that_is_shifted_by_hand_is_reported_as_reverse() -> None:
    fleet = fleet_of_one()
    fleet.set_control(7, VehicleControl(manual_gear_shift=True, gear=-1))
    assert fleet.reverse.tolist() == [True]
    fleet.set_control(7, VehicleControl(manual_gear_shift=True, gear=1))
    assert fleet.reverse.tolist() == [False]


def test_hand_brake_holds_against_throttle_of_a_parking_car() -> None:
    fleet = fleet_of_one()
    drive(fleet, 2.0, throttle=0.5, hand_brake=True)
    assert fleet.velocity[0, 0] == 0.0


@pytest.mark.parametrize("steer", [0.1, 0.25, 0.5])
def test_slow_turning_radius_follows_the_single_track_model(steer: float) -> None:
    fleet = fleet_of_one()
    fleet.set_constant_velocity(7, (2.0, 0.0, 0.0))
    drive(fleet, 6.0, steer=steer)  # until the tyres have turned it in
    vehicle = parameters()
    angle_deg = float(fleet.wheel_angle_deg[0])
    # 7.2 km/h lies on the first slope of the steering curve.
    assert angle_deg == pytest.approx(steer * 70.0 * (1.0 - 0.1 * 7.2 / 20.0), abs=0.05)
    radius_m = vehicle.wheelbase_m / math.tan(math.radians(angle_deg))
    yaw_rate = math.radians(fleet.angular_velocity_deg[0, 2])
    assert yaw_rate == pytest.approx(2.0 / radius_m, rel=1e-6)


def test_positive_steering_turns_right() -> None:
    fleet = fleet_of_one()
    drive(fleet, 2.0, throttle=0.5, steer=0.3)
    assert fleet.rotation_deg[0, 1] > 0.0
    assert fleet.angular_velocity_deg[0, 2] > 0.0
    assert fleet.location[0, 1] > -4.0


def test_full_steering_at_speed_stays_within_the_tyres_grip() -> None:
    fleet = fleet_of_one()
    fleet.set_target_velocity(7, (20.0, 0.0, 0.0))
    drive(fleet, 1.0, throttle=0.5, steer=1.0)
    speed = float(np.linalg.norm(fleet.velocity[0]))
    lateral = speed * math.radians(fleet.angular_velocity_deg[0, 2])
    assert lateral == pytest.approx(parameters().max_lateral_acceleration, rel=0.05)


def test_a_vehicle_spawned_in_the_air_falls_and_stays_on_the_ground() -> None:
    fleet = VehicleFleet()
    fleet.add(7, parameters(), (0.0, 0.0, 0.5), (0.0, 90.0, 0.0))
    heights = []
    for _ in range(20):
        fleet.step(DELTA_S, SUBSTEPS)
        heights.append(fleet.location[0, 2])
    assert np.all(np.diff(heights) <= 0.0)
    assert heights[2] > 0.3
    assert heights[-1] == 0.0
    assert fleet.velocity[0, 2] == 0.0


def slope(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """10 % uphill along x, 5 % down to the right."""
    return 0.1 * points[:, 0] - 0.05 * points[:, 1]


def test_pitch_roll_and_height_follow_the_ground() -> None:
    fleet = VehicleFleet(slope)
    fleet.add(7, parameters(), (20.0, 10.0, 1.5), (0.0, 0.0, 0.0))
    fleet.set_control(7, VehicleControl(0.0, 0.0, 1.0, False, False))
    fleet.step(DELTA_S, SUBSTEPS)
    fleet.step(DELTA_S, SUBSTEPS)
    assert fleet.location[0, 2] == pytest.approx(1.5)
    assert fleet.rotation_deg[0, 0] == pytest.approx(math.degrees(math.atan(0.1)), rel=1e-3)
    # Positive roll lowers the right side.
    assert fleet.rotation_deg[0, 2] == pytest.approx(math.degrees(math.atan(0.05)), rel=1e-3)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)
    fleet.set_control(7, VehicleControl(0.0, 0.0, 0.0, False, False))
    for _ in range(20):
        fleet.step(DELTA_S, SUBSTEPS)
    assert fleet.velocity[0, 0] < -0.3


def test_teleport_is_not_motion_but_a_moved_kinematic_vehicle_has_velocity() -> None:
    fleet = fleet_of_one()
    fleet.set_transform(7, (100.0, 0.0, 0.0), (0.0, 90.0, 0.0))
    fleet.step(DELTA_S, SUBSTEPS)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)
    fleet.set_simulate_physics(7, False)
    fleet.set_transform(7, (100.0, 0.5, 0.0), (0.0, 90.0, 0.0))
    fleet.set_control(7, VehicleControl(1.0, 0.0, 0.0, False, False))
    fleet.step(DELTA_S, SUBSTEPS)
    np.testing.assert_allclose(fleet.velocity[0], (0.0, 10.0, 0.0))
    np.testing.assert_allclose(fleet.location[0], (100.0, 0.5, 0.0))
    # As on CARLA, which makes the body anew.
    fleet.set_simulate_physics(7, True)
    fleet.set_control(7, VehicleControl())
    fleet.step(DELTA_S, SUBSTEPS)
    assert fleet.velocity[0, 1] == 0.0
    fleet.set_target_velocity(7, (0.0, 10.0, 0.0))
    fleet.step(DELTA_S, SUBSTEPS)
    assert fleet.velocity[0, 1] == pytest.approx(10.0, abs=0.3)


def test_who_was_put_elsewhere_without_physics_begins_at_rest_with_them() -> None:
    fleet = fleet_of_one()
    fleet.set_simulate_physics(7, False)
    fleet.set_transform(7, (12.0, -4.0, 0.0), (0.0, 30.0, 0.0))
    fleet.set_simulate_physics(7, True)
    fleet.step(DELTA_S, SUBSTEPS)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)
    np.testing.assert_array_equal(fleet.angular_velocity_deg[0], 0.0)


def test_constant_velocity_ignores_the_pedals_until_it_ends() -> None:
    fleet = fleet_of_one()
    fleet.set_constant_velocity(7, (6.0, 1.0, 0.0))
    drive(fleet, 1.0, brake=1.0)
    np.testing.assert_allclose(fleet.velocity[0], (6.0, 1.0, 0.0), atol=1e-9)
    fleet.set_constant_velocity(7, None)
    drive(fleet, 1.0, brake=1.0)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)


def test_however_fast_a_vehicle_drives_it_tells_its_velocity() -> None:
    fleet = fleet_of_one()
    fleet.set_constant_velocity(7, (200.0, 0.0, 0.0))
    drive(fleet, 1.0)
    np.testing.assert_allclose(fleet.velocity[0], (200.0, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(fleet.acceleration[0], 0.0, atol=1e-6)


def test_rows_ascend_by_id_and_unknown_or_double_ids_are_refused() -> None:
    fleet = VehicleFleet()
    for actor_id in (30, 10, 20):
        fleet.add(actor_id, parameters(), (actor_id, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert fleet.location[:, 0].tolist() == [10.0, 20.0, 30.0]
    fleet.remove(10)
    assert fleet.ids.tolist() == [20, 30]
    assert fleet.location[fleet.row(20), 0] == 20.0
    with pytest.raises(KeyError):
        fleet.row(10)
    with pytest.raises(ValueError, match="exists already"):
        fleet.add(20, parameters(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_equal_commands_give_equal_bytes_whatever_else_is_in_the_fleet() -> None:
    alone, crowded = fleet_of_one(), VehicleFleet()
    for actor_id in range(20, 50):
        crowded.add(actor_id, parameters("vehicle.audi.tt"), (actor_id, 50.0, 0.0), (0, 0, 0))
    crowded.add(7, parameters(), (10.0, -4.0, 0.0), (0.0, 0.0, 0.0))
    crowded.step(DELTA_S, SUBSTEPS)
    for tick in range(100):
        for fleet in (alone, crowded):
            fleet.set_control(7, VehicleControl(0.6, math.sin(tick / 9.0), 0.0, False, False))
            fleet.step(DELTA_S, SUBSTEPS)
    row = crowded.row(7)
    assert crowded.location[row].tobytes() == alone.location[0].tobytes()
    assert crowded.rotation_deg[row].tobytes() == alone.rotation_deg[0].tobytes()


def test_controls_out_of_range_are_clamped_and_nan_is_zero() -> None:
    fleet = fleet_of_one()
    fleet.set_control(7, VehicleControl(3.0, -9.0, math.nan, False, False))
    np.testing.assert_array_equal(fleet.control[0], (1.0, -1.0, 0.0))
