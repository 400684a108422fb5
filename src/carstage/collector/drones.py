"""Drones: carriers of sensors that are set to their place ahead of every step.

Sensors hang rigidly on their carrier, so the server moves them with it, before the step in which
they measure: a frame shows what is seen from the place that the snapshot of that frame has.
"""

from __future__ import annotations

from math import cos, hypot, radians, sin
from typing import Any, Dict, List, NamedTuple, Optional

import carla

from carstage.collector.world import WorldSession
from carstage.spec.drones import DroneSpec, EgoPlace, Point

_ON_TIME = 1.0 + 1e-9
"""A path that is flown at the greatest speed is not late by what rounding makes of it."""


class DronePose(NamedTuple):
    """Place (m) and direction (degrees) of what carries a drone's sensors."""

    place: Point
    pitch_deg: float
    yaw_deg: float


class Motion(NamedTuple):
    """How a drone moves, in CARLA's world axes: m/s, m/s² and degrees/s."""

    velocity: Point
    acceleration: Point
    angular_velocity_deg: Point


STILL = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class DroneMotion:
    """Where a drone is, step by step.

    Args:
        spec: how it flies.
        step_s: simulated time of a step.
        ego: where the ego begins.
    """

    def __init__(self, spec: DroneSpec, step_s: float, ego: EgoPlace) -> None:
        self._spec = spec
        self._step_s = step_s
        wanted = spec.path.at(0.0, ego)
        self.pose = DronePose(
            wanted.place, *spec.gimbal.direction(wanted.place, wanted.heading_deg, ego)
        )
        self.motion = STILL

    def advance(self, time_s: float, ego: EgoPlace) -> None:
        """Make the next step, as far as the greatest speed allows towards where the path is.

        Args:
            time_s: since the first recorded step; 0 before it.
            ego: where the ego will be, as far as that is known.
        """
        before, moved_before = self.pose, self.motion
        wanted = self._spec.path.at(time_s, ego)
        place = self._towards(before.place, wanted.place)
        direction = self._spec.gimbal.direction(place, wanted.heading_deg, ego)
        self.pose = DronePose(place, *direction)
        velocity = self._rate(before.place, place)
        pitch_rate, yaw_rate = (
            _turned_deg(old, new) / self._step_s for old, new in zip(before[1:], direction)
        )
        yaw = radians(direction[1])
        self.motion = Motion(
            velocity,
            self._rate(moved_before.velocity, velocity),
            # Pitch is about the axis to the right, against it, as x turns to z.
            (pitch_rate * sin(yaw), -pitch_rate * cos(yaw), yaw_rate),
        )

    def _towards(self, here: Point, wanted: Point) -> Point:
        most_m = self._spec.max_speed_m_s * self._step_s
        way = [b - a for a, b in zip(here, wanted)]
        way_m = hypot(hypot(way[0], way[1]), way[2])
        if way_m <= most_m * _ON_TIME:
            return wanted
        x, y, z = (a + most_m / way_m * b for a, b in zip(here, way))
        return (x, y, z)

    def _rate(self, before: Point, now: Point) -> Point:
        x, y, z = ((b - a) / self._step_s for a, b in zip(before, now))
        return (x, y, z)


class DroneFlight:
    """Moves a drone's carrier in the world.

    Args:
        session: the episode's world.
        spec: how it flies.
        actor: what carries its sensors.
        ego: the ego's ``carla.Vehicle``.
        step_s: simulated time of a step.
    """

    def __init__(
        self, session: WorldSession, spec: DroneSpec, actor: Any, ego: Any, step_s: float
    ) -> None:
        self._session = session
        self._actor = actor
        self._ego = ego
        self._step_s = step_s
        self._drone = DroneMotion(spec, step_s, ego_place(ego.get_transform()))

    def before_step(self, tick: Optional[int]) -> None:
        """Set the carrier to where it is in the next step; ``tick`` is None in the warm-up."""
        self._drone.advance((tick or 0) * self._step_s, self._next_ego_place())
        # Not a call that waits: commands reach the server in the order in which they are sent.
        self._session.client.apply_batch(
            [carla.command.ApplyTransform(self._actor.id, transform_of(self._drone.pose))]
        )

    @property
    def noted(self) -> Dict[str, List[float]]:
        """How it moves in the step at hand, as the log has it; servers say that it stands."""
        return {name: list(values) for name, values in self._drone.motion._asdict().items()}

    def _next_ego_place(self) -> EgoPlace:
        """Where the ego is after a step at the speed that it was last seen at."""
        seen = ego_place(self._ego.get_transform())
        velocity = self._ego.get_velocity()
        return seen._replace(
            x_m=seen.x_m + velocity.x * self._step_s,
            y_m=seen.y_m + velocity.y * self._step_s,
            z_m=seen.z_m + velocity.z * self._step_s,
        )


def first_transform(spec: DroneSpec, step_s: float, start: Any) -> Any:
    """``carla.Transform`` where a drone begins; ``start`` is where the ego does."""
    return transform_of(DroneMotion(spec, step_s, ego_place(start)).pose)


def ego_place(transform: Any) -> EgoPlace:
    """The ego's place from its ``carla.Transform``."""
    location = transform.location
    return EgoPlace(location.x, location.y, location.z, transform.rotation.yaw)


def transform_of(pose: DronePose) -> Any:
    """The ``carla.Transform`` of a pose."""
    return carla.Transform(
        carla.Location(*pose.place), carla.Rotation(pitch=pose.pitch_deg, yaw=pose.yaw_deg)
    )


def _turned_deg(before: float, now: float) -> float:
    """The shorter way from one angle to another."""
    return (now - before + 180.0) % 360.0 - 180.0
