"""The controller behind ``apply_ackermann_control``: a steering angle and a speed become pedals.

As in CARLA, a speed loop moves the wanted acceleration, an acceleration loop moves the pedals, and
the steering angle turns no faster than asked. Who is to go the other way stops first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from carstage_sim.world.controls import AckermannControl, AckermannSettings, VehicleControl
from carstage_sim.world.vehicles.parameters import VehicleParameters

_STANDSTILL_M_PER_S = 0.1
_GAINS_PERIOD_S = 0.05
"""CARLA adds each loop's output to its target once per frame, so that its gains depend on the frame
rate. Here they mean 20 frames per second at every rate."""
_SMOOTHING_S = 0.2


@dataclass(slots=True)
class _Loop:
    """A PID loop; it remembers the sum of errors and the last one."""

    total: float = 0.0
    last: float = 0.0

    def run(self, error: float, kp: float, ki: float, kd: float, delta_s: float) -> float:
        self.total += error * delta_s
        slope = (error - self.last) / delta_s
        self.last = error
        return kp * error + ki * self.total + kd * slope


@dataclass(slots=True)
class AckermannController:
    """One vehicle's controller.

    Attributes:
        target: what it follows.
        gains: of its two loops.
    """

    target: AckermannControl
    gains: AckermannSettings
    _speed_loop: _Loop = field(default_factory=_Loop)
    _acceleration_loop: _Loop = field(default_factory=_Loop)
    _acceleration: float = 0.0
    _pedal: float = 0.0
    _steer_rad: float = 0.0
    _speed: float | None = None
    _measured: float = 0.0
    _reverse: bool = False

    def step(self, speed: float, parameters: VehicleParameters, delta_s: float) -> VehicleControl:
        """Pedals and wheel for the next ``delta_s`` seconds of a vehicle at ``speed`` m/s."""
        steer = self._steer(math.radians(parameters.max_steer_angle_deg), delta_s)
        measured = self._measured_acceleration(speed, delta_s)
        wanted = self.target.speed
        if abs(wanted) < _STANDSTILL_M_PER_S and abs(speed) < _STANDSTILL_M_PER_S:
            self._acceleration = self._pedal = 0.0
            return VehicleControl(0.0, steer, 1.0, reverse=self._reverse)
        if abs(speed) < _STANDSTILL_M_PER_S:
            self._reverse = wanted < 0.0
        elif speed * wanted < 0.0:
            wanted = 0.0
        share = delta_s / _GAINS_PERIOD_S
        self._follow_speed(wanted, speed, parameters, delta_s)
        error = self._acceleration - measured
        gains = self.gains
        change = self._acceleration_loop.run(
            error, gains.accel_kp, gains.accel_ki, gains.accel_kd, delta_s
        )
        self._pedal = min(max(self._pedal + change * share, -1.0), 1.0)
        push = -self._pedal if self._reverse else self._pedal
        return VehicleControl(max(push, 0.0), steer, max(-push, 0.0), reverse=self._reverse)

    def _measured_acceleration(self, speed: float, delta_s: float) -> float:
        if self._speed is not None:
            now = (speed - self._speed) / delta_s
            self._measured += (now - self._measured) * -math.expm1(-delta_s / _SMOOTHING_S)
        self._speed = speed
        return self._measured

    def _steer(self, largest_rad: float, delta_s: float) -> float:
        wanted = min(max(self.target.steer_rad, -largest_rad), largest_rad)
        if self.target.steer_speed > 0.0:
            reach = self.target.steer_speed * delta_s
            wanted = min(max(wanted, self._steer_rad - reach), self._steer_rad + reach)
        self._steer_rad = wanted
        return wanted / largest_rad if largest_rad else 0.0

    def _follow_speed(
        self, wanted: float, speed: float, parameters: VehicleParameters, delta_s: float
    ) -> None:
        gains = self.gains
        change = self._speed_loop.run(
            wanted - speed, gains.speed_kp, gains.speed_ki, gains.speed_kd, delta_s
        ) * (delta_s / _GAINS_PERIOD_S)
        limit = abs(self.target.acceleration)
        up = limit or parameters.max_acceleration
        down = limit or parameters.max_deceleration
        self._acceleration = min(max(self._acceleration + change, -down), up)
