"""How long a car takes to 100 km/h and to stop from there, beside what its physics control says.

The car is driven by a client, on its throttle and brake alone. The expectation is the textbook's
(Rajamani, "Vehicle Dynamics and Control", chapters 4 and 5), computed from nothing but what
``Vehicle.get_physics_control`` reports: none of the simulator's own code has a part in it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import carla

from benchmarks.simulator.session import Session, synchronous_session

BLUEPRINTS = (
    "vehicle.audi.a2",
    "vehicle.lincoln.mkz_2020",
    "vehicle.mercedes.sprinter",
    "vehicle.nissan.patrol_2021",
    "vehicle.tesla.model3",
)
"""From 1.0 to 2.8 tons."""

_FAST_M_S = 100.0 / 3.6
_DELTA_S = 0.02
_LONGEST_S = 60.0
_SETTLED_S = 1.0
_STRAIGHT_M = 400.0
_STEP_M = 20.0
_STRAIGHT_DEG = 0.5
_LEVEL_M = 1.0
_AIR_TIMES_AREA_HALF = 1.3  # kg/m: 2.2 m2 of frontal area in air of 1.2 kg/m3, halved
_ROLLING = 0.012  # of the weight: car tyres on asphalt
_GRAVITY = 9.81
_REACTION_S = 1.0 / 6.0
"""In which Unreal presses a pedal down (``VehicleInputRate``: 6 per second)."""


@dataclass(frozen=True, slots=True)
class StraightLine:
    """What a car does on a straight and level road.

    Attributes:
        to_100_km_h_s: from rest at full throttle.
        braking_m: way from 100 km/h to rest at full brake.
        hardest_m_s2: the strongest deceleration in a tick meanwhile; NaN for an expectation.
    """

    to_100_km_h_s: float
    braking_m: float
    hardest_m_s2: float = math.nan


def straight_line_trial(port: int, *, seed: int) -> dict[str, tuple[StraightLine, StraightLine]]:
    """Measured and expected, by blueprint; runs in the client's process.

    Raises:
        RuntimeError: the map has no straight road, or a car does not get fast or to rest.
    """
    with synchronous_session(port, delta_s=_DELTA_S, seed=seed) as session:
        place = _straight_road(session.world.get_map())
        result = {}
        for name in BLUEPRINTS:
            blueprint = session.world.get_blueprint_library().find(name)
            car = session.world.spawn_actor(blueprint, place)
            session.clock.tick()
            expected = expectation(car.get_physics_control())
            result[name] = _measured(session, car), expected
            car.destroy()
            session.clock.tick()
    return result


def expectation(physics: carla.VehiclePhysicsControl) -> StraightLine:
    """What the reported values give: engine, gears, drag and brakes."""
    speed = clock_s = shifting_s = way_m = 0.0
    gear = 0
    while speed < _FAST_M_S and clock_s < _LONGEST_S:
        pull, wants_up = _pull(physics, gear, speed)
        if wants_up and shifting_s <= 0.0:
            gear, shifting_s = gear + 1, physics.gear_switch_time
        pull = 0.0 if shifting_s > 0.0 else pull * min(clock_s / _REACTION_S, 1.0)
        shifting_s -= _DELTA_S
        clock_s += _DELTA_S
        speed += (pull - _resistance(physics, speed)) * _DELTA_S
        speed = max(speed, 0.0)
    torque = sum(wheel.max_brake_torque / (wheel.radius / 100.0) for wheel in physics.wheels)
    rolling, pressed = _FAST_M_S, 0.0
    while rolling > 0.0:
        pressed = min(pressed + _DELTA_S / _REACTION_S, 1.0)
        way_m += rolling * _DELTA_S
        rolling -= (pressed * torque / physics.mass + _resistance(physics, rolling)) * _DELTA_S
    return StraightLine(clock_s, way_m)


def _pull(physics: carla.VehiclePhysicsControl, gear: int, speed: float) -> tuple[float, bool]:
    """Acceleration (m/s²) at full throttle, and whether the box is to shift up."""
    one = physics.forward_gears[gear]
    driven = [wheel for wheel in physics.wheels if wheel.max_steer_angle == 0.0]
    radius_m = driven[0].radius / 100.0
    ratio = one.ratio * physics.final_ratio
    turning = speed * ratio / radius_m
    rpm = turning * 60.0 / (2.0 * math.pi)
    torque = _between(physics.torque_curve, rpm) - physics.damping_rate_full_throttle * turning
    moved_kg = physics.mass + physics.moi * (ratio / radius_m) ** 2
    last = gear + 1 == len(physics.forward_gears)
    wants_up = not last and rpm > _shift_rpm(physics, gear)
    return (torque if rpm < physics.max_rpm else 0.0) * ratio / radius_m / moved_kg, wants_up


def _shift_rpm(physics: carla.VehiclePhysicsControl, gear: int) -> float:
    """Where the box shifts up: never so early that the next gear would shift back at once."""
    one, following = physics.forward_gears[gear], physics.forward_gears[gear + 1]
    return float(
        physics.max_rpm * max(one.up_ratio, following.down_ratio * one.ratio / following.ratio)
    )


def _between(curve: list[carla.Vector2D], x: float) -> float:
    """A curve's value, linear between its points and constant beyond them."""
    for low, high in itertools.pairwise(curve):
        if x <= high.x:
            share = max(x - low.x, 0.0) / (high.x - low.x)
            return float(low.y + share * (high.y - low.y))
    return float(curve[-1].y)


def _resistance(physics: carla.VehiclePhysicsControl, speed: float) -> float:
    drag = physics.drag_coefficient * _AIR_TIMES_AREA_HALF * speed * speed / physics.mass
    return float(drag + (_ROLLING * _GRAVITY if speed > 0.0 else 0.0))


def _measured(session: Session, car: carla.Vehicle) -> StraightLine:
    for _ in range(round(_SETTLED_S / _DELTA_S)):
        session.clock.tick()
    ticks = 0
    for _ in _ticks(session, car, carla.VehicleControl(throttle=1.0)):
        ticks += 1
        if car.get_velocity().length() >= _FAST_M_S:
            break
    begin, hardest, before = car.get_location(), 0.0, car.get_velocity().length()
    first_m_s = before
    for _ in _ticks(session, car, carla.VehicleControl(brake=1.0)):
        now = car.get_velocity().length()
        hardest, before = max(hardest, (before - now) / _DELTA_S), now
        if now < 0.01:
            break
    # A tick may end a little above 100 km/h; the way grows with the square of the speed.
    way_m = begin.distance(car.get_location()) * (_FAST_M_S / first_m_s) ** 2
    return StraightLine(ticks * _DELTA_S, way_m, hardest)


def _ticks(session: Session, car: carla.Vehicle, control: carla.VehicleControl) -> Iterator[None]:
    """Ticks with pedals pressed, for as long as somebody looks.

    Raises:
        RuntimeError: nobody was content within a minute.
    """
    car.apply_control(control)
    for _ in range(round(_LONGEST_S / _DELTA_S)):
        session.clock.tick()
        yield
    raise RuntimeError(f"{car.type_id} reached neither 100 km/h nor rest in {_LONGEST_S:g} s")


def _straight_road(town: carla.Map) -> carla.Transform:
    """The begin of a straight and level piece of a road.

    Raises:
        RuntimeError: the map has none.
    """
    for start in town.generate_waypoints(_STEP_M):
        ahead = [start]
        while len(ahead) * _STEP_M <= _STRAIGHT_M:
            following = ahead[-1].next(_STEP_M)
            if len(following) != 1 or following[0].is_junction:
                break
            ahead.append(following[0])
        poses = [point.transform for point in ahead]
        yaws = [math.radians(pose.rotation.yaw - poses[0].rotation.yaw) for pose in poses]
        heights = [pose.location.z for pose in poses]
        bends = max(abs(math.degrees(math.asin(math.sin(yaw)))) for yaw in yaws)
        long_enough = len(ahead) * _STEP_M > _STRAIGHT_M
        if long_enough and bends < _STRAIGHT_DEG and max(heights) - min(heights) < _LEVEL_M:
            poses[0].location.z += 0.3
            return poses[0]
    raise RuntimeError(f"no straight and level road of {_STRAIGHT_M:g} m in {town.name}")
