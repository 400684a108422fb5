"""All vehicles of the world as one struct of arrays, stepped together.

The order within a tick is: clients' commands (the setters), :meth:`VehicleFleet.step`, snapshot.
What the snapshot reports is consistent by construction: the velocity is the displacement of the
tick over its duration, the acceleration the change of that velocity over the duration. Teleports
(:meth:`VehicleFleet.set_transform` of a simulated vehicle) are not motion.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.world import vehicle_dynamics as dynamics
from carstage_sim.world.contacts import Contact, find_contacts, resolve_contacts
from carstage_sim.world.vehicle_parameters import VehicleParameters
from carstage_sim.world.vehicle_rows import empty_rows, parameter_values

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GroundHeight = Callable[[FloatArray], FloatArray]
"""Height of the ground, ``(M,)`` metres, under points ``(M, 3)`` of the world."""

_STICKS_TO_GROUND_M = 0.15
_TELEPORT_SPEED = 150.0
_FREE_SPIN_TIME_S = 0.2
_GEAR_SPEEDS = np.array([6.0, 11.0, 17.0])  # m/s, shift points that the snapshot's gear follows


class VehicleFleet:
    """Every vehicle's state and motion.

    Args:
        ground_height: height of the ground under world points; None is a plane at z = 0.
    """

    def __init__(self, ground_height: GroundHeight | None = None) -> None:
        self._ground_height = ground_height
        self._rows = empty_rows()
        self._row_of: dict[int, int] = {}
        self.contacts: list[tuple[Contact, float]] = []
        """Vehicles that touched in the last tick, by row, and the impulse (N s) of each contact."""

    def __len__(self) -> int:
        return len(self._row_of)

    @property
    def ids(self) -> NDArray[np.uint32]:
        """``(N,)`` actor ids in row order, the order of :meth:`add`."""
        return self._rows.ids

    @property
    def location(self) -> FloatArray:
        """``(N, 3)`` world metres."""
        return self._rows.location

    @property
    def rotation_deg(self) -> FloatArray:
        """``(N, 3)`` pitch, yaw, roll in degrees; yaw within [-180, 180)."""
        return self._rows.rotation_deg

    @property
    def velocity(self) -> FloatArray:
        """``(N, 3)`` m/s in the world: the last tick's displacement over its duration."""
        return self._rows.velocity

    @property
    def angular_velocity_deg(self) -> FloatArray:
        """``(N, 3)`` deg/s in the world: the last tick's rotation vector over its duration."""
        return self._rows.angular_velocity_deg

    @property
    def acceleration(self) -> FloatArray:
        """``(N, 3)`` m/s^2 in the world: the last tick's change of velocity over its duration."""
        return self._rows.acceleration

    @property
    def control(self) -> NDArray[np.float32]:
        """``(N, 3)`` throttle, steer, brake as last set."""
        return self._rows.control

    @property
    def hand_brake(self) -> BoolArray:
        """``(N,)`` hand brake as last set."""
        return self._rows.hand_brake

    @property
    def reverse(self) -> BoolArray:
        """``(N,)`` whether a reverse gear is engaged."""
        return self._rows.reverse

    @property
    def gear(self) -> NDArray[np.int32]:
        """``(N,)`` gear that the automatic box would be in: -1 in reverse, else 1 to 4."""
        forward = 1 + np.searchsorted(_GEAR_SPEEDS, np.abs(self._rows.speed), side="right")
        return np.where(self._rows.reverse, -1, forward).astype(np.int32)

    @property
    def wheel_angle_deg(self) -> FloatArray:
        """``(N,)`` angle of the front wheels, positive to the right."""
        return self._rows.wheel_angle_deg

    @property
    def inverse_mass(self) -> FloatArray:
        """``(N,)`` 1/kg; 0 for what cannot be pushed."""
        return np.where(self._rows.simulated, self._rows.inverse_mass, 0.0)

    @property
    def collides(self) -> BoolArray:
        """``(N,)`` whether a vehicle pushes others and is pushed."""
        return self._rows.collides

    def footprints(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Boxes of the vehicles: ``(N, 3)`` centres, ``(N, 2)`` half sizes, ``(N,)`` yaws (rad)."""
        rows = self._rows
        yaw_rad = np.radians(rows.rotation_deg[:, 1])
        center = rows.location.copy()
        center[:, 0] += rows.box_center_x * np.cos(yaw_rad)
        center[:, 1] += rows.box_center_x * np.sin(yaw_rad)
        return center, rows.half_size, yaw_rad

    def row(self, actor_id: int) -> int:
        """Row of an actor.

        Raises:
            KeyError: no such vehicle.
        """
        return self._row_of[actor_id]

    def add(
        self,
        actor_id: int,
        parameters: VehicleParameters,
        location: ArrayLike,
        rotation_deg: ArrayLike,
    ) -> None:
        """Adds a vehicle at rest; it falls to the ground from where it is put.

        Raises:
            ValueError: the id is in use.
        """
        if actor_id in self._row_of:
            raise ValueError(f"vehicle {actor_id} exists already")
        location = np.asarray(location, dtype=np.float64)
        rotation = np.asarray(rotation_deg, dtype=np.float64)
        values: dict[str, ArrayLike] = {
            "ids": actor_id,
            "location": location,
            "rotation_deg": rotation,
            "origin_location": location,
            "origin_rotation_deg": rotation,
            "airborne": True,
            "simulated": True,
            "collides": True,
            "constant_velocity": np.full(3, np.nan),
            **parameter_values(parameters),
        }
        self._rows.append(values)
        self._row_of[actor_id] = len(self._row_of)

    def remove(self, actor_id: int) -> None:
        """Removes a vehicle; the rows after it move up.

        Raises:
            KeyError: no such vehicle.
        """
        self._rows.delete(self.row(actor_id))
        self._row_of = {int(i): index for index, i in enumerate(self._rows.ids)}

    def set_parameters(self, actor_id: int, parameters: VehicleParameters) -> None:
        """Replaces the dynamics of a vehicle (``Vehicle.apply_physics_control``)."""
        self._rows.set(self.row(actor_id), parameter_values(parameters))

    def set_control(
        self,
        actor_id: int,
        throttle: float,
        steer: float,
        brake: float,
        hand_brake: bool,
        reverse: bool,
        gear: int,
    ) -> None:
        """Sets the pedals and the wheel until the next call.

        Args:
            throttle, brake: 0 to 1; values outside are clamped, NaN is 0.
            steer: -1 (left) to 1 (right).
            gear: negative engages reverse, as ``reverse`` does; other gears are automatic.
        """
        row = self.row(actor_id)
        pedals = np.nan_to_num(np.array([throttle, steer, brake], dtype=np.float64))
        self._rows.control[row] = np.clip(pedals, (0.0, -1.0, 0.0), 1.0)
        self._rows.hand_brake[row] = hand_brake
        self._rows.reverse[row] = reverse or gear < 0

    def set_transform(self, actor_id: int, location: ArrayLike, rotation_deg: ArrayLike) -> None:
        """Puts a vehicle elsewhere.

        A simulated vehicle keeps its speed along the new heading, and the jump is not motion. For
        one with physics off the way from the last tick's pose is its motion.
        """
        row, rows = self.row(actor_id), self._rows
        rows.location[row] = location
        rows.rotation_deg[row] = rotation_deg
        if rows.simulated[row]:
            rows.origin_location[row] = location
            rows.origin_rotation_deg[row] = rotation_deg
            rows.airborne[row] = True
            rows.fall_speed[row] = 0.0

    def set_wheel_angle(self, actor_id: int, angle_deg: float) -> None:
        """Turns the front wheels of a vehicle that only :meth:`set_transform` moves."""
        self._rows.wheel_angle_deg[self.row(actor_id)] = angle_deg

    def set_target_velocity(self, actor_id: int, velocity: ArrayLike) -> None:
        """Gives a vehicle a world velocity (m/s) at once; tyres keep only its part ahead."""
        row = self.row(actor_id)
        vector = np.asarray(velocity, dtype=np.float64)
        forward = rotation_matrix(self._rows.rotation_deg[row])[:, 0]
        self._rows.speed[row] = float(vector @ forward)
        if vector[2] > 0.1:
            self._rows.airborne[row] = True
            self._rows.fall_speed[row] = -float(vector[2])

    def set_target_angular_velocity(self, actor_id: int, angular_velocity_deg: ArrayLike) -> None:
        """Gives a vehicle a spin (deg/s) about the vertical, which its tyres soon take away."""
        spin = float(np.asarray(angular_velocity_deg, dtype=np.float64)[2])
        self._rows.free_yaw_rate[self.row(actor_id)] = np.radians(spin)

    def set_simulate_physics(self, actor_id: int, enabled: bool) -> None:
        """Switches the dynamics of a vehicle; off, only :meth:`set_transform` moves it."""
        row, rows = self.row(actor_id), self._rows
        if enabled and not rows.simulated[row]:
            forward = rotation_matrix(rows.rotation_deg[row])[:, 0]
            rows.speed[row] = float(rows.velocity[row] @ forward)
            rows.fall_speed[row] = 0.0
            rows.airborne[row] = True
        rows.simulated[row] = enabled

    def set_collides(self, actor_id: int, enabled: bool) -> None:
        """Whether a vehicle pushes others and is pushed."""
        self._rows.collides[self.row(actor_id)] = enabled

    def set_constant_velocity(self, actor_id: int, velocity: ArrayLike | None) -> None:
        """Holds a velocity (m/s, in the vehicle's frame) whatever the pedals say; None ends it."""
        row = self.row(actor_id)
        value = np.full(3, np.nan) if velocity is None else np.asarray(velocity, dtype=np.float64)
        self._rows.constant_velocity[row] = value

    def step(self, delta_s: float, substeps: int) -> None:
        """Moves every vehicle by ``delta_s`` seconds in ``substeps`` equal parts.

        Raises:
            ValueError: a duration or a count that is not positive.
        """
        if not delta_s > 0.0 or substeps < 1:
            raise ValueError(f"cannot step {delta_s} s in {substeps} parts")
        rows = self._rows
        self.contacts = []
        if len(rows.ids) == 0:
            return
        for _ in range(substeps):
            self._substep(delta_s / substeps)
        self._part()
        self._account(delta_s)

    def _substep(self, dt_s: float) -> None:
        rows = self._rows
        rolling = rows.simulated & ~rows.airborne
        throttle, steer, brake = rows.control.astype(np.float64).T
        pitch_rad, yaw_rad, _ = np.radians(rows.rotation_deg).T
        speed = dynamics.next_speed(
            rows.speed,
            throttle=throttle,
            brake=brake,
            hand_brake=rows.hand_brake,
            direction=np.where(rows.reverse, -1.0, 1.0),
            slope_acceleration=-dynamics.GRAVITY * np.sin(pitch_rad),
            max_acceleration=rows.max_acceleration,
            power_per_mass=rows.power_per_mass,
            max_deceleration=rows.max_deceleration,
            max_reverse_speed=rows.max_reverse_speed,
            drag_per_mass=rows.drag_per_mass,
            dt_s=dt_s,
        )
        speed = np.where(rolling, speed, rows.speed)
        held = ~np.isnan(rows.constant_velocity[:, 0])
        speed = np.where(held, rows.constant_velocity[:, 0], speed)
        sideways = np.where(held, rows.constant_velocity[:, 1], 0.0)

        share = dynamics.steering_share(rows.steering_curve, speed)
        angle_deg = dynamics.next_steer_angle(
            rows.wheel_angle_deg, steer * share * rows.max_steer_deg, dt_s
        )
        wheelbase = rows.front_axle_x - rows.rear_axle_x
        rate = dynamics.yaw_rate(speed, angle_deg, wheelbase, rows.max_lateral_acceleration)
        rate = np.where(rows.airborne, 0.0, rate) + rows.free_yaw_rate

        heading = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
        rear = rows.location[:, :2] + rows.rear_axle_x[:, None] * heading
        rear = rear + dynamics.arc_displacement(speed * np.cos(pitch_rad), yaw_rad, rate, dt_s)
        rear = rear + (sideways * dt_s)[:, None] * np.stack(
            [-heading[:, 1], heading[:, 0]], axis=-1
        )
        yaw_rad = yaw_rad + rate * dt_s
        heading = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
        location = rear - rows.rear_axle_x[:, None] * heading

        moved = rows.simulated
        rows.speed = np.where(moved, speed, rows.speed)
        rows.wheel_angle_deg = np.where(moved, angle_deg, rows.wheel_angle_deg)
        rows.free_yaw_rate = rows.free_yaw_rate * np.exp(-dt_s / _FREE_SPIN_TIME_S)
        rows.location[:, :2] = np.where(moved[:, None], location, rows.location[:, :2])
        yaw_deg = (np.degrees(yaw_rad) + 180.0) % 360.0 - 180.0
        rows.rotation_deg[:, 1] = np.where(moved, yaw_deg, rows.rotation_deg[:, 1])
        self._follow_ground(dt_s)

    def _part(self) -> None:
        """Keeps vehicles out of each other."""
        rows = self._rows
        center, half_size, yaw_rad = self.footprints()
        contacts = [
            contact
            for contact in find_contacts(center, half_size, yaw_rad)
            if rows.collides[contact.first] and rows.collides[contact.second]
        ]
        impulses = resolve_contacts(contacts, rows.location, rows.speed, yaw_rad, self.inverse_mass)
        self.contacts = list(zip(contacts, impulses, strict=True))

    def _follow_ground(self, dt_s: float) -> None:
        """Height, pitch and roll from the ground under the wheels; free fall above it."""
        rows = self._rows
        ground, pitch_deg, roll_deg = self._ground_plane()
        fall = np.where(rows.airborne, rows.fall_speed + dynamics.GRAVITY * dt_s, 0.0)
        height = rows.location[:, 2] - fall * dt_s
        stays_up = rows.airborne & (height > ground)
        leaves = ~rows.airborne & (height > ground + _STICKS_TO_GROUND_M)
        airborne = stays_up | leaves
        on_ground = rows.simulated & ~airborne
        rows.fall_speed = np.where(airborne, fall, 0.0)
        rows.airborne = airborne
        rows.location[:, 2] = np.where(
            on_ground, ground, np.where(rows.simulated, height, rows.location[:, 2])
        )
        rows.rotation_deg[:, 0] = np.where(on_ground, pitch_deg, rows.rotation_deg[:, 0])
        rows.rotation_deg[:, 2] = np.where(on_ground, roll_deg, rows.rotation_deg[:, 2])

    def _ground_plane(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height at the origin, pitch and roll (deg) of the plane through the four wheels."""
        rows = self._rows
        count = len(rows.ids)
        if self._ground_height is None:
            zero = np.zeros(count)
            return zero, zero, zero
        yaw_rad = np.radians(rows.rotation_deg[:, 1])
        forward = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
        right = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
        wheels = np.empty((4, count, 3))
        wheels[:, :, 2] = rows.location[:, 2]
        corners = (
            (rows.front_axle_x, -rows.half_track),
            (rows.front_axle_x, rows.half_track),
            (rows.rear_axle_x, -rows.half_track),
            (rows.rear_axle_x, rows.half_track),
        )
        for corner, (x, y) in enumerate(corners):
            wheels[corner, :, :2] = rows.location[:, :2] + x[:, None] * forward + y[:, None] * right
        z = self._ground_height(wheels.reshape(-1, 3)).reshape(4, count)
        front, rear = 0.5 * (z[0] + z[1]), 0.5 * (z[2] + z[3])
        left, right_side = 0.5 * (z[0] + z[2]), 0.5 * (z[1] + z[3])
        wheelbase = rows.front_axle_x - rows.rear_axle_x
        pitch = np.degrees(np.arctan2(front - rear, wheelbase))
        # Two-wheelers have no track: they stay upright.
        roll = np.degrees(np.arctan2(left - right_side, np.maximum(2.0 * rows.half_track, 0.1)))
        height = rear + (front - rear) * (-rows.rear_axle_x / wheelbase)
        return height, pitch, roll

    def _account(self, delta_s: float) -> None:
        """Velocities and accelerations of the tick, from where each vehicle was and is."""
        rows = self._rows
        velocity = (rows.location - rows.origin_location) / delta_s
        jumped = np.linalg.norm(velocity, axis=1) > _TELEPORT_SPEED
        velocity = np.where(jumped[:, None], 0.0, velocity)
        rows.acceleration = (velocity - rows.velocity) / delta_s
        rows.velocity = velocity
        turned = rotation_matrix(rows.rotation_deg) @ np.swapaxes(
            rotation_matrix(rows.origin_rotation_deg), 1, 2
        )
        rows.angular_velocity_deg = np.degrees(_rotation_vector(turned)) / delta_s
        rows.angular_velocity_deg[jumped] = 0.0
        rows.origin_location = rows.location.copy()
        rows.origin_rotation_deg = rows.rotation_deg.copy()


def _rotation_vector(matrices: FloatArray) -> FloatArray:
    """Axis times angle (rad) of ``(N, 3, 3)`` rotations by less than half a turn, ``(N, 3)``."""
    axis = 0.5 * np.stack(
        [
            matrices[:, 2, 1] - matrices[:, 1, 2],
            matrices[:, 0, 2] - matrices[:, 2, 0],
            matrices[:, 1, 0] - matrices[:, 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(axis, axis=1)
    cosine = 0.5 * (np.trace(matrices, axis1=1, axis2=2) - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    return np.asarray(axis * scale[:, None])
