"""All vehicles of the world as one struct of arrays, stepped together.

The order within a tick is: clients' commands (the setters), :meth:`VehicleFleet.step`, snapshot.
What the snapshot reports is consistent by construction: the velocity is the displacement of the
tick over its duration, the acceleration the change of that velocity over the duration. Teleports
(:meth:`VehicleFleet.set_transform` of a simulated vehicle) are not motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.world.columns import Control
from carstage_sim.world.contacts.crashes import LONGEST_WAY_M, NOTHING, Crashes, Others, centers
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles import dynamics as dynamics
from carstage_sim.world.vehicles.motion import substep, tick_constants
from carstage_sim.world.vehicles.parameters import VehicleParameters
from carstage_sim.world.vehicles.riding import (
    GroundHeight,
    flat_ground,
    follow_ground,
    time_to_land,
)
from carstage_sim.world.vehicles.rows import empty_rows, parameter_values

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LONGEST_SUBSTEP_S = 0.02
"""Longer physics steps are split, so that the result hardly depends on the tick's length."""

_TELEPORT_SPEED = 150.0
_MOST_SUBSTEPS = 1000
_LIFTS_OFF = 0.1  # m/s upwards


class VehicleFleet:
    """Every vehicle's state and motion.

    Args:
        ground_height: height of the ground under world points; None is a plane at z = 0.
        obstacles: what of the town vehicles run into; None for nothing.
    """

    def __init__(
        self, ground_height: GroundHeight | None = None, obstacles: Obstacles | None = None
    ) -> None:
        self._ground_height = ground_height or flat_ground
        self._rows = empty_rows()
        self._row_of: dict[int, int] = {}
        self._commanded: dict[int, VehicleControl] = {}
        self.crashes = Crashes(obstacles)
        """What touched in the last tick."""

    def __len__(self) -> int:
        return len(self._row_of)

    @property
    def ids(self) -> NDArray[np.uint32]:
        """``(N,)`` actor ids, ascending: the order of the rows."""
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
        self._apply_commands()
        return self._rows.control

    @property
    def hand_brake(self) -> BoolArray:
        """``(N,)`` hand brake as last set."""
        self._apply_commands()
        return self._rows.hand_brake

    @property
    def reverse(self) -> BoolArray:
        """``(N,)`` whether a reverse gear is engaged, however it was asked for, as on CARLA."""
        return self.gear < 0

    @property
    def speed(self) -> FloatArray:
        """``(N,)`` m/s along the heading, negative backwards."""
        return self._rows.speed

    @property
    def gear(self) -> NDArray[np.int64]:
        """``(N,)`` engaged gear: -1 in reverse, 0 in neutral, 1 and up ahead."""
        self._apply_commands()
        return self._rows.gear

    @property
    def manual(self) -> BoolArray:
        """``(N,)`` whether clients shift the gears themselves."""
        return self._rows.manual

    @property
    def speed_limit_kmh(self) -> NDArray[np.float32]:
        """``(N,)`` limit of the last sign that each vehicle passed."""
        return self._rows.speed_limit_kmh

    @property
    def wheel_angle_deg(self) -> FloatArray:
        """``(N,)`` angle of the front wheels, positive to the right."""
        return self._rows.wheel_angle_deg

    @property
    def rolled_m(self) -> FloatArray:
        """``(N,)`` way along the heading since each was spawned."""
        return self._rows.rolled_m

    @property
    def collides(self) -> BoolArray:
        """``(N,)`` whether a vehicle pushes others and is pushed."""
        return self._rows.collides

    def footprints(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Boxes of the vehicles: ``(N, 3)`` centres, ``(N, 2)`` half sizes, ``(N,)`` yaws (rad)."""
        center, yaw_rad = centers(self._rows)
        return center, self._rows.half_size, yaw_rad

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
            "gravity": True,
            "gear": 1,
            "constant_velocity": np.full(3, np.nan),
            **parameter_values(parameters),
        }
        self._rows.insert(int(np.searchsorted(self.ids, actor_id)), values)
        self._reindex()
        self.set_grip()

    def remove(self, actor_id: int) -> None:
        """Removes a vehicle; the rows after it move up.

        Raises:
            KeyError: no such vehicle.
        """
        self._rows.delete(self.row(actor_id))
        self._commanded.pop(actor_id, None)
        self._reindex()

    def _reindex(self) -> None:
        self._row_of = {int(i): index for index, i in enumerate(self._rows.ids)}

    def see_signs(self, limit_kmh: NDArray[np.float32], posted_kmh: NDArray[np.float32]) -> None:
        """Changes the speed limits of vehicles that have none yet, or pass a sign.

        Args:
            limit_kmh: ``(N,)`` where each vehicle is, for those that have just appeared.
            posted_kmh: ``(N,)`` on the sign that each vehicle passes, 0 for none.
        """
        old = self._rows.speed_limit_kmh
        known = np.where(old > 0.0, old, limit_kmh)
        self._rows.speed_limit_kmh = np.where(posted_kmh > 0.0, posted_kmh, known)

    # Commands ------------------------------------------------------------------------------------

    def set_parameters(self, actor_id: int, parameters: VehicleParameters) -> None:
        """Replaces the dynamics of a vehicle (``Vehicle.apply_physics_control``)."""
        row = self.row(actor_id)
        self._rows.set(row, parameter_values(parameters))
        self._rows.gear[row] = min(self._rows.gear[row], self._rows.gear_count[row])
        self.set_grip()

    def set_control(self, actor_id: int, control: VehicleControl) -> None:
        """Sets the pedals, the wheel and the gear until the next call.

        Pedals beyond 0 to 1 and steering beyond -1 to 1 are clamped, NaN is 0.

        Raises:
            KeyError: no such vehicle.
        """
        self.row(actor_id)
        self._commanded[actor_id] = control

    def set_transform(self, actor_id: int, location: ArrayLike, rotation_deg: ArrayLike) -> None:
        """Puts a vehicle elsewhere.

        A simulated vehicle keeps its velocity in the world (Unreal's ``TeleportPhysics``), and the
        jump is not motion. For one with physics off the way from the last tick's pose is its
        motion.
        """
        row, rows = self.row(actor_id), self._rows
        velocity = self._velocity_now(row)
        rows.location[row] = location
        rows.rotation_deg[row] = rotation_deg
        if rows.simulated[row]:
            rows.origin_location[row] = location
            rows.origin_rotation_deg[row] = rotation_deg
            rows.airborne[row] = True
            self._set_velocity(row, velocity)

    def forget_way(self, actor_id: int, velocity: ArrayLike) -> None:
        """Takes the way of a vehicle since the last tick out of its motion.

        Args:
            actor_id: one with physics off.
            velocity: what it was in the last tick, m/s, world.
        """
        row, rows = self.row(actor_id), self._rows
        rows.origin_location[row] = rows.location[row]
        rows.origin_rotation_deg[row] = rows.rotation_deg[row]
        rows.velocity[row] = velocity

    def set_wheel_angle(self, actor_id: int, angle_deg: float) -> None:
        """Turns the front wheels of a vehicle that only :meth:`set_transform` moves."""
        self._rows.wheel_angle_deg[self.row(actor_id)] = angle_deg

    def set_target_velocity(self, actor_id: int, velocity: ArrayLike) -> None:
        """Gives a vehicle a world velocity (m/s) at once; its tyres soon take what is sideways."""
        self._set_velocity(self.row(actor_id), np.asarray(velocity, dtype=np.float64))

    def set_target_angular_velocity(self, actor_id: int, angular_velocity_deg: ArrayLike) -> None:
        """Gives a vehicle a spin (deg/s) about the vertical, which its tyres soon take away."""
        spin = float(np.asarray(angular_velocity_deg, dtype=np.float64)[2])
        self._rows.spin[self.row(actor_id)] = np.radians(spin)

    def add_impulse(
        self, actor_id: int, impulse: ArrayLike, location: ArrayLike | None = None
    ) -> None:
        """Pushes a vehicle at once.

        Args:
            impulse: N s, world.
            location: where, world metres; None for the middle of the vehicle. Beside the middle it
                makes the vehicle spin about the vertical; it never pitches or rolls.
        """
        row, rows = self.row(actor_id), self._rows
        vector = np.asarray(impulse, dtype=np.float64)
        self._set_velocity(row, self._velocity_now(row) + vector * rows.inverse_mass[row])
        rows.spin[row] += self._moment(row, vector, location) * rows.inverse_inertia[row]

    def add_angular_impulse(self, actor_id: int, about_vertical: float) -> None:
        """Makes a vehicle spin at once (N m s about the vertical, positive to the right)."""
        row = self.row(actor_id)
        self._rows.spin[row] += about_vertical * self._rows.inverse_inertia[row]

    def add_force(self, actor_id: int, force: ArrayLike, location: ArrayLike | None = None) -> None:
        """Pushes a vehicle with a force (N, world) during the next step, as an impulse does."""
        row = self.row(actor_id)
        vector = np.asarray(force, dtype=np.float64)
        self._rows.force[row] += vector
        self._rows.torque_up[row] += self._moment(row, vector, location)

    def add_torque(self, actor_id: int, about_vertical: float) -> None:
        """Turns a vehicle with a torque (N m about the vertical) during the next step."""
        self._rows.torque_up[self.row(actor_id)] += about_vertical

    def set_simulate_physics(self, actor_id: int, enabled: bool) -> None:
        """Switches the dynamics of a vehicle; off, only :meth:`set_transform` moves it.

        CARLA makes the body anew when it switches them on: it begins at rest, in first gear.
        """
        row, rows = self.row(actor_id), self._rows
        if enabled and not rows.simulated[row]:
            rows.airborne[row] = True
            rows.spin[row] = rows.turn_rate[row] = rows.shift_left_s[row] = 0.0
            rows.throttle[row] = rows.brake[row] = 0.0
            rows.gear[row] = 1
            rows.origin_location[row] = rows.location[row]
            rows.origin_rotation_deg[row] = rows.rotation_deg[row]
            self._set_velocity(row, np.zeros(3))
        rows.simulated[row] = enabled

    def set_gravity(self, actor_id: int, enabled: bool) -> None:
        """Whether a vehicle falls."""
        self._rows.gravity[self.row(actor_id)] = enabled

    def set_collides(self, actor_id: int, enabled: bool) -> None:
        """Whether a vehicle pushes others and is pushed."""
        self._rows.collides[self.row(actor_id)] = enabled

    def set_constant_velocity(self, actor_id: int, velocity: ArrayLike | None) -> None:
        """Holds a velocity (m/s, in the vehicle's frame) whatever the pedals say; None ends it."""
        row = self.row(actor_id)
        if velocity is None and not np.isnan(self._rows.constant_velocity[row, 0]):
            self._rows.slide[row] = 0.0
        value = np.full(3, np.nan) if velocity is None else np.asarray(velocity, dtype=np.float64)
        self._rows.constant_velocity[row] = value

    def set_grip(
        self, puddles_percent: float = 0.0, zone_friction: FloatArray | None = None
    ) -> None:
        """Sets how well tyres hold until the next call.

        Args:
            puddles_percent: how much water is on the road, ``precipitation_deposits``.
            zone_friction: ``(N,)`` tyre friction that a friction trigger imposes; NaN outside.
        """
        rows = self._rows
        friction = rows.tire_friction
        if zone_friction is not None:
            friction = np.where(np.isnan(zone_friction), friction, zone_friction)
        rows.grip = dynamics.grip(friction, puddles_percent)

    def _set_velocity(self, row: int, velocity: FloatArray) -> None:
        """Velocity of a vehicle's origin, world m/s."""
        rows = self._rows
        forward, right, _ = rotation_matrix(rows.rotation_deg[row]).T
        turn = rows.turn_rate[row] + rows.spin[row]
        rows.speed[row] = float(velocity @ forward)
        rows.slide[row] = float(velocity @ right) + turn * rows.rear_axle_x[row]
        if rows.airborne[row]:
            rows.vertical_speed[row] = velocity[2]
        else:
            climb = float(velocity[2] - rows.speed[row] * forward[2])
            if climb > _LIFTS_OFF:
                rows.airborne[row] = True
                rows.vertical_speed[row] = velocity[2]

    def _velocity_now(self, row: int) -> FloatArray:
        """Velocity of a vehicle's origin, with all commands since the last step; world m/s."""
        rows = self._rows
        forward, right, _ = rotation_matrix(rows.rotation_deg[row]).T
        turn = rows.turn_rate[row] + rows.spin[row]
        aside = rows.slide[row] - turn * rows.rear_axle_x[row]
        velocity = rows.speed[row] * forward + aside * right
        if rows.airborne[row]:
            velocity[2] = rows.vertical_speed[row]
        return np.asarray(velocity)

    def _moment(self, row: int, force: FloatArray, location: ArrayLike | None) -> float:
        if location is None:
            return 0.0
        x, y = (np.asarray(location, dtype=np.float64) - self._rows.location[row])[:2]
        return float(x * force[1] - y * force[0])

    # The step ------------------------------------------------------------------------------------

    def step(
        self,
        delta_s: float,
        substeps: int,
        *,
        moving_s: float | None = None,
        others: Others = NOTHING,
        before_substep: Callable[[float], None] | None = None,
    ) -> None:
        """Moves every vehicle by one tick.

        Args:
            delta_s: the tick's duration.
            substeps: equal parts to split it into, at least; more where they would be too long.
            moving_s: seconds that the physics take part in, all of the tick by default.
            others: what else can be hit.
            before_substep: called with the duration of each part before it, for controllers.

        Raises:
            ValueError: a duration or a count that is not positive.
        """
        if not delta_s > 0.0 or substeps < 1:
            raise ValueError(f"cannot step {delta_s} s in {substeps} parts")
        moving_s = delta_s if moving_s is None else moving_s
        rows = self._rows
        self.crashes.begin(others)
        if len(rows.ids) == 0:
            return
        self._apply_commands()
        fastest = float((np.abs(rows.speed) + np.abs(rows.slide)).max())
        parts = max(
            substeps,
            math.ceil(moving_s / LONGEST_SUBSTEP_S - 1e-6),
            math.ceil(fastest * moving_s / LONGEST_WAY_M),
        )
        parts = min(parts, max(substeps, _MOST_SUBSTEPS))
        part_s = moving_s / parts
        began_at = rows.location.copy()
        lands_in_s = time_to_land(rows, self._ground_height)
        constants, way_m = tick_constants(rows, lands_in_s), 0.0
        for index in range(parts):
            if before_substep is not None:
                before_substep(part_s)
                if self._apply_commands():
                    constants = tick_constants(rows, lands_in_s)
            way_m += substep(rows, constants, index * part_s, part_s) * part_s
            if way_m + fastest * part_s > LONGEST_WAY_M or index == parts - 1:
                self.crashes.look(rows)
                way_m = 0.0
        follow_ground(rows, self._ground_height, began_at, moving_s)
        rows.force[:] = 0.0
        rows.torque_up[:] = 0.0
        self._account(delta_s, moving_s)

    def _apply_commands(self) -> bool:
        """Writes the controls since the last call into their rows; whether there were any."""
        if not self._commanded:
            return False
        rows = self._rows
        at = np.array([self._row_of[actor_id] for actor_id in self._commanded])
        controls = np.array(list(self._commanded.values()), np.float64)
        rows.control[at] = np.clip(
            np.nan_to_num(controls[:, : Control.HAND_BRAKE]), (0.0, -1.0, 0.0), 1.0
        )
        rows.hand_brake[at], reverse, rows.manual[at] = (
            controls[:, Control.HAND_BRAKE : Control.GEAR].T != 0.0
        )
        before = rows.gear[at]
        chosen = np.clip(controls[:, Control.GEAR], -1.0, rows.gear_count[at]).astype(np.int64)
        gear = np.where(rows.manual[at], chosen, np.maximum(before, 1))
        gear = np.where(reverse, -1, gear)
        shifts = (gear != before) & (gear > 0) & (before > 0)
        rows.shift_left_s[at] = np.where(shifts, rows.shift_time[at], rows.shift_left_s[at])
        rows.gear[at] = gear
        self._commanded.clear()
        return True

    def _account(self, delta_s: float, moving_s: float) -> None:
        """Velocities and accelerations of the tick, from where each vehicle was and is."""
        rows = self._rows
        took_s = np.where(rows.simulated, moving_s, delta_s)[:, None]
        velocity = (rows.location - rows.origin_location) / took_s
        jumped = np.einsum("nk,nk->n", velocity, velocity) > _TELEPORT_SPEED**2
        jumped &= ~rows.simulated  # whose teleports do not count as their way
        if jumped.any():
            velocity[jumped] = 0.0
        rows.acceleration = (velocity - rows.velocity) / took_s
        rows.velocity = velocity
        rotations = rotation_matrix(rows.rotation_deg)
        rows.rolled_m += (velocity * took_s * rotations[:, :, 0]).sum(axis=1)
        turned = rotations @ np.swapaxes(rotation_matrix(rows.origin_rotation_deg), 1, 2)
        rows.angular_velocity_deg = np.degrees(_rotation_vector(turned)) / took_s
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
