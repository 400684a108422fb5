"""How who takes part in a storyboard moves: exactly as it says."""

from __future__ import annotations

import math
from typing import Any, Optional, Tuple

import carla

from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.events.cars import (
    BRAKE,
    HARD_M_S2,
    LEFT,
    RIGHT,
    DrivenCar,
    LaneLine,
    half_wave,
)
from carstage.collector.scenario.events.lanes import lanes_over
from carstage.collector.scenario.events.surroundings import Surroundings
from carstage.spec.storyboard import StoryDynamics

STEEPEST = {"linear": 1.0, "sinusoidal": 0.5 * math.pi, "cubic": 1.5}
"""The largest slope of each shape, in changes per duration."""
WALKER_Z_M = 1.0


class Change:
    """A value on its way from one to another.

    Args:
        begin, end: the values.
        shape: of the way.
        length: s or m that the way takes.

    Attributes:
        ends_at: the last value.
    """

    def __init__(self, begin: float, end: float, shape: str, length: float) -> None:
        self._begin = begin
        self.ends_at = end
        self._shape = shape
        self._length = 0.0 if shape == "step" else length
        self._done = 0.0
        self._begun = self._left = False

    @property
    def is_over(self) -> bool:
        """Whether it is at its end, or another took its place."""
        return self._left or (self._begun and self._done >= self._length - 1e-6)

    def leave(self) -> None:
        """Another takes its place."""
        self._left = True

    def advance(self, by: float) -> float:
        """The value, so many s or m further on."""
        self._begun = True
        self._done += by
        share = min(self._done / self._length, 1.0) if self._length > 1e-9 else 1.0
        if self._shape == "sinusoidal":
            share = half_wave(share)
        elif self._shape == "cubic":
            share = share * share * (3.0 - 2.0 * share)
        return self._begin + share * (self.ends_at - self._begin)


OVER = Change(0.0, 0.0, "step", 0.0)
OVER.leave()
"""What takes no time."""


def speed_change(begin_m_s: float, end_m_s: float, dynamics: StoryDynamics) -> Change:
    """A change of speed; a distance is driven at the mean of both speeds."""
    length_s = dynamics.value
    if dynamics.dimension == "rate" and dynamics.shape != "step":
        length_s = STEEPEST[dynamics.shape] * abs(end_m_s - begin_m_s) / dynamics.value
    elif dynamics.dimension == "distance":
        length_s = dynamics.value / max(0.5 * (begin_m_s + end_m_s), 1e-3)
    return Change(begin_m_s, end_m_s, dynamics.shape, length_s)


class Mover:
    """Somebody who stands.

    Args:
        world: takes commands for the next step.
        world_map: ``carla.Map``.
        actor: ``carla.Actor``.
        transform: where it begins, on the ground.
    """

    def __init__(self, world: Surroundings, world_map: Any, actor: Any, transform: Any) -> None:
        self._world = world
        self._map = world_map
        self._actor = actor
        self._transform = transform
        self._speed: Optional[Change] = None
        self.speed_m_s = 0.0

    def run_up(self, speed_m_s: float, steps_left: int) -> None:
        """Come to its place at a speed; called in the last steps before the first, and in that.

        A simulator takes differences of places for velocities, and differences of those for
        accelerations.

        Args:
            speed_m_s: how fast.
            steps_left: until the first recorded step.
        """
        if not steps_left:
            self.speed_m_s = speed_m_s

    def change_speed(self, end_m_s: float, dynamics: StoryDynamics) -> Change:
        """Have it change its speed from the next step on."""
        if self._speed is not None:
            self._speed.leave()
        self._speed = speed_change(self.speed_m_s, max(end_m_s, 0.0), dynamics)
        return self._speed

    def change_lane(self, left: int, lane: Optional[int], dynamics: StoryDynamics) -> Change:
        """Have it change lanes from the next step on."""
        raise NotImplementedError

    def teleport(self, transform: Any) -> None:
        """Put it elsewhere, on the ground."""
        self._transform = transform
        self._world.commands.append(carla.command.ApplyTransform(self._actor.id, transform))

    def brake(self) -> None:
        """Have it come to a stand."""
        self.change_speed(0.0, StoryDynamics("linear", "rate", HARD_M_S2))

    def step(self) -> None:
        """Move it on by a step."""

    def _next_speed_m_s(self) -> float:
        if self._speed is None or self._speed.is_over:
            return self.speed_m_s
        return self._speed.advance(self._world.step_s)


class StoryWalker(Mover):
    """A pedestrian who walks straight on, the way it faces."""

    def run_up(self, speed_m_s: float, steps_left: int) -> None:
        """See ``Mover``; pedestrians begin at their place."""
        super().run_up(speed_m_s, steps_left)
        self._walk()

    def teleport(self, transform: Any) -> None:
        """See ``Mover``."""
        at = transform.location
        at = carla.Location(at.x, at.y, at.z + WALKER_Z_M)
        super().teleport(carla.Transform(at, transform.rotation))

    def step(self) -> None:
        """See ``Mover``."""
        self.speed_m_s = self._next_speed_m_s()
        self._walk()

    def _walk(self) -> None:
        yaw = math.radians(self._transform.rotation.yaw)
        ahead = carla.Vector3D(math.cos(yaw), math.sin(yaw), 0.0)
        control = carla.WalkerControl(ahead, self.speed_m_s, False)
        self._world.commands.append(carla.command.ApplyWalkerControl(self._actor.id, control))


class StoryCar(Mover):
    """A vehicle that follows its lane, as far from its middle as it was, without physics.

    It brakes for nobody. Against the traffic it drives where it faces that way. Until it drives,
    it stands as it was put.
    """

    def __init__(self, world: Surroundings, world_map: Any, actor: Any, transform: Any) -> None:
        super().__init__(world, world_map, actor, transform)
        self._car: Optional[DrivenCar] = None
        self._right_m = 0.0
        self._lane: Optional[Change] = None
        self._lane_by_distance = False
        self._lane_type = carla.LaneType.Driving
        actor.set_simulate_physics(False)
        self.teleport(transform)

    def run_up(self, speed_m_s: float, steps_left: int) -> None:
        """See ``Mover``."""
        if self._car is not None or speed_m_s <= 0.0:
            self.step()
        else:
            self.speed_m_s = speed_m_s
            self._follow_lane(speed_m_s, -steps_left * speed_m_s * self._world.step_s)

    def teleport(self, transform: Any) -> None:
        """See ``Mover``."""
        super().teleport(transform)
        self._car = None
        if self._lane is not None:
            self._lane.leave()

    def change_lane(self, left: int, lane: Optional[int], dynamics: StoryDynamics) -> Change:
        """See ``Mover``.

        Raises:
            SceneError: there is no such lane beside it.
        """
        if self._lane is not None:
            self._lane.leave()
        self._follow_lane()
        place, against = self._place()
        found = lanes_over(place, -left if against else left, lane)
        if found is None:
            words = "lane %d" % lane if lane is not None else "lane %d to the left" % left
            raise SceneError(
                "scenario.file: %s has no %s beside it." % (self._actor.type_id, words),
                "Have it change lanes where there is one.",
            )
        target, right_m = found
        self._lane_type = target.lane_type
        end_m = -right_m if against else right_m
        length = dynamics.value
        if dynamics.dimension == "rate" and dynamics.shape != "step":
            way_m = abs(end_m - self._right_m)
            length = STEEPEST[dynamics.shape] * way_m / dynamics.value
        self._lane_by_distance = dynamics.dimension == "distance"
        self._lane = Change(self._right_m, end_m, dynamics.shape, length)
        return self._lane

    def step(self) -> None:
        """See ``Mover``."""
        before_m_s, self.speed_m_s = self.speed_m_s, self._next_speed_m_s()
        if self._lane is not None and self._lane.is_over:
            self._lane = None
            if not self._place()[0].is_junction:  # where lanes cross, the nearest may be another
                self._follow_lane()
        if self._car is None:
            if self.speed_m_s <= 0.0:
                self._world.light(self._actor)
                return
            self._follow_lane(before_m_s)
        assert self._car is not None
        lights = BRAKE if self.speed_m_s < before_m_s else 0
        if self._lane is not None:
            lights |= RIGHT if self._lane.ends_at > self._right_m else LEFT
            mean_m = 0.5 * (before_m_s + self.speed_m_s) * self._world.step_s
            by = mean_m if self._lane_by_distance else self._world.step_s
            self._right_m = self._lane.advance(by)
        self._car.move(self.speed_m_s, self._right_m, lights)

    def _place(self) -> Tuple[Any, bool]:
        """The waypoint where it is, and whether it drives against that lane's direction."""
        if self._car is not None:
            x, y, z, _, yaw = self._car.pose
            self._transform = self._world.transform(x, y, z, yaw)
        place = self._map.get_waypoint(self._transform.location, True, self._lane_type)
        turned = self._transform.rotation.yaw - place.transform.rotation.yaw
        return place, math.cos(math.radians(turned)) < 0.0

    def _follow_lane(self, speed_m_s: Optional[float] = None, along_m: float = 0.0) -> None:
        place, against = self._place()
        line = LaneLine(place, against=against)
        x, y, _, _, yaw_deg = line.pose(0.0)
        at, yaw = self._transform.location, math.radians(yaw_deg)
        self._right_m = (at.y - y) * math.cos(yaw) - (at.x - x) * math.sin(yaw)
        speed_m_s = self.speed_m_s if speed_m_s is None else speed_m_s
        self._car = DrivenCar(self._world, self._actor, line, along_m, speed_m_s, self._right_m)
