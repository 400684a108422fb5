"""One vehicle's motion of the last frame, along its own axes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VehicleMotion:
    """Speed along the heading (m/s), accelerations (m/s^2), pedals, wheel angle and gear."""

    speed: float = 0.0
    forward_acceleration: float = 0.0
    lateral_acceleration: float = 0.0
    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    wheel_angle_deg: float = 0.0
    gear: int = 1
