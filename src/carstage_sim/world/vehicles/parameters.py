"""What a vehicle is to the dynamics, and what ``carla.VehiclePhysicsControl`` reports of it.

The client's Traffic Manager reads some of these numbers (``max_steer_angle`` scales its steering,
the bounding box its collision polygons), so they follow CARLA's vehicles and are not tuned for
looks.
"""

from __future__ import annotations

from dataclasses import dataclass

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Wheel:
    """One wheel, in the fields of ``carla.WheelPhysicsControl``.

    Attributes:
        position_m: wheel centre in the vehicle's frame, metres (the wire reports centimetres in
            the world).
        radius_m: metres (the wire reports centimetres).
        max_steer_angle_deg: 0 for wheels that do not steer.
        max_brake_torque, max_handbrake_torque: N m.
    """

    position_m: Vector3
    radius_m: float
    max_steer_angle_deg: float
    max_handbrake_torque: float
    tire_friction: float = 3.5
    damping_rate: float = 0.25
    max_brake_torque: float = 1500.0
    lat_stiff_max_load: float = 2.0
    lat_stiff_value: float = 17.0
    long_stiff_value: float = 1000.0


@dataclass(frozen=True, slots=True)
class Gear:
    """A forward gear: its ratio, and the engine speeds (as shares) at which the box shifts."""

    ratio: float
    down_ratio: float = 0.5
    up_ratio: float = 0.65


@dataclass(frozen=True, slots=True)
class VehicleParameters:
    """Single-track parameters and the reported physics control of one vehicle.

    Attributes:
        wheels: front left, front right, rear left, rear right. Two-wheelers have four, too, as on
            CARLA; left and right are at the same place.
        front_axle_x_m, rear_axle_x_m: axle positions in the vehicle's frame; rear is negative.
        track_m: distance between the left and right wheels.
        mass_kg: kerb weight.
        box_center_x_m, half_length_m, half_width_m: footprint for contacts, in the vehicle's frame.
        height_m: of the box's top above the road.
        max_acceleration: m/s^2 at full throttle and low speed.
        power_per_mass: W/kg at the wheels; bounds the acceleration at speed v to ``power / v``.
        max_deceleration: m/s^2 at full brake.
        max_lateral_acceleration: m/s^2, what the tyres hold in a turn. A road car holds 7 to 8; the
            Traffic Manager takes some bends faster (at 7.5, cars slid 3 m out of one in Town03).
        max_reverse_speed: m/s.
        blueprint_mass_kg: mass that ``power_per_mass`` belongs to; 0 for ``mass_kg`` itself.
        drivetrain_efficiency: share of the engine's torque that pushes the vehicle.
        brake_gain: share of the brakes' torque that slows it down.
        steering_curve: (speed km/h, share of the steering angle), ascending speeds.
    """

    wheels: tuple[Wheel, ...]
    front_axle_x_m: float
    rear_axle_x_m: float
    track_m: float
    mass_kg: float
    box_center_x_m: float
    half_length_m: float
    half_width_m: float
    height_m: float
    max_acceleration: float = 4.5
    power_per_mass: float = 75.0
    max_deceleration: float = 9.0
    max_lateral_acceleration: float = 11.0
    max_reverse_speed: float = 8.0
    blueprint_mass_kg: float = 0.0
    drivetrain_efficiency: float = 1.0
    brake_gain: float = 1.0
    torque_curve: tuple[tuple[float, float], ...] = ((0.0, 400.0), (1890.0, 500.0), (5729.0, 400.0))
    max_rpm: float = 5729.0
    moi: float = 1.0
    damping_rate_full_throttle: float = 0.15
    damping_rate_zero_throttle_clutch_engaged: float = 2.0
    damping_rate_zero_throttle_clutch_disengaged: float = 0.35
    use_gear_autobox: bool = True
    gear_switch_time_s: float = 0.5
    clutch_strength: float = 10.0
    final_ratio: float = 4.0
    forward_gears: tuple[Gear, ...] = (Gear(2.85), Gear(2.02), Gear(1.35), Gear(1.0))
    drag_coefficient: float = 0.3
    center_of_mass: Vector3 = (0.45, 0.0, -0.3)
    steering_curve: tuple[tuple[float, float], ...] = (
        (0.0, 1.0),
        (20.0, 0.9),
        (60.0, 0.8),
        (120.0, 0.7),
    )
    use_sweep_wheel_collision: bool = True

    @property
    def wheelbase_m(self) -> float:
        """Distance between the axles."""
        return self.front_axle_x_m - self.rear_axle_x_m

    @property
    def max_steer_angle_deg(self) -> float:
        """Largest angle of the steered wheels."""
        return max(wheel.max_steer_angle_deg for wheel in self.wheels)
