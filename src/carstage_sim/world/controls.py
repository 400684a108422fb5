"""What clients command: vehicle and walker controls, episode settings."""

from __future__ import annotations

import math
from dataclasses import dataclass

from carstage_sim.world.pose import ZERO, Vector3


@dataclass(frozen=True, slots=True)
class VehicleControl:
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


@dataclass(frozen=True, slots=True)
class WalkerControl:
    """``carla.WalkerControl``: a unit direction in the world, speed in m/s."""

    direction: Vector3 = (1.0, 0.0, 0.0)
    speed: float = 0.0
    jump: bool = False


STANDING = WalkerControl(direction=ZERO)


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

    def substeps(self, delta_s: float) -> int:
        """Physics steps within one tick of ``delta_s`` seconds."""
        if not self.substepping or self.max_substep_delta_time <= 0.0:
            return 1
        wanted = math.ceil(delta_s / self.max_substep_delta_time - 1e-6)
        return max(1, min(wanted, self.max_substeps))


@dataclass(frozen=True, slots=True)
class AckermannSettings:
    """``carla.AckermannControllerSettings``: gains of the speed and acceleration loops."""

    speed_kp: float = 0.15
    speed_ki: float = 0.0
    speed_kd: float = 0.25
    accel_kp: float = 0.01
    accel_ki: float = 0.0
    accel_kd: float = 0.01
