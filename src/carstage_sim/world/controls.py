"""What clients command: vehicle and walker controls, episode settings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from carstage_sim.world.pose import ZERO, Vector3


class VehicleControl(NamedTuple):
    """``carla.VehicleControl``: throttle and brake 0..1, steer -1..1 (positive turns right)."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


@dataclass(frozen=True, slots=True)
class AckermannControl:
    """``carla.VehicleAckermannControl``: steer in rad, speeds in m/s, acceleration in m/s^2."""

    steer_rad: float = 0.0
    steer_speed: float = 0.0
    speed: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0


class WalkerControl(NamedTuple):
    """``carla.WalkerControl``: a direction in the world, whose length times the speed is in m/s."""

    direction: Vector3 = (1.0, 0.0, 0.0)
    speed: float = 0.0
    jump: bool = False


STANDING = WalkerControl(direction=ZERO)

_MAX_PHYSICS_DELTA_S = 0.33333  # CARLA's DefaultEngine.ini


@dataclass(frozen=True, slots=True)
class PhysicsStep:
    """The part of a tick that vehicles move in, and the number of equal steps that it takes."""

    duration_s: float
    substeps: int = 1


@dataclass(frozen=True, slots=True)
class EpisodeSettings:
    """``carla.WorldSettings``; the defaults are CARLA's."""

    synchronous_mode: bool = False
    no_rendering_mode: bool = False
    fixed_delta_seconds: float | None = None
    substepping: bool = True
    max_substep_delta_time: float = 0.01
    max_substeps: int = 10
    max_culling_distance: float = 0.0
    deterministic_ragdolls: bool = True
    tile_stream_distance: float = 3000.0
    actor_active_distance: float = 2000.0
    spectator_as_ego: bool = True

    def physics(self, delta_s: float) -> PhysicsStep:
        """How vehicles move within a tick of ``delta_s`` seconds.

        As in Unreal 4 (``FPhysSubstepTask::UpdateTime``): with substepping a tick that is longer
        than ``max_substep_delta_time * max_substeps`` moves them by that product only: simulated
        time runs away from the physics. Without, ticks above ``MaxPhysicsDeltaTime`` do so.
        """
        if not self.substepping or self.max_substep_delta_time <= 0.0:
            return PhysicsStep(min(delta_s, _MAX_PHYSICS_DELTA_S), 1)
        most = max(self.max_substeps, 1)
        duration_s = min(delta_s, self.max_substep_delta_time * most)
        parts = math.ceil(duration_s / self.max_substep_delta_time - 1e-6)
        return PhysicsStep(duration_s, max(1, min(parts, most)))


@dataclass(frozen=True, slots=True)
class AckermannSettings:
    """``carla.AckermannControllerSettings``: gains of the speed and acceleration loops."""

    speed_kp: float = 0.15
    speed_ki: float = 0.0
    speed_kd: float = 0.25
    accel_kp: float = 0.01
    accel_ki: float = 0.0
    accel_kd: float = 0.01
