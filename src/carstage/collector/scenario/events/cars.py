"""Cars of events: moved along a lane without physics, so that they do exactly what is asked."""

from __future__ import annotations

import math
from typing import Any, List, Optional, Sequence, Tuple

import carla

from carstage.collector.scenario.events.surroundings import SPACING_M, Surroundings

BRAKE = int(carla.VehicleLightState.Brake)
LEFT = int(carla.VehicleLightState.LeftBlinker)
RIGHT = int(carla.VehicleLightState.RightBlinker)
HAZARD = LEFT | RIGHT

GENTLE_M_S2 = 3.0
"""How fast a car changes its speed that keeps a distance."""
BETWEEN_M = 4.0
"""It stays that far from a car before it."""
LOOK_M = 30
"""So far ahead it looks for one."""
HARD_M_S2 = 8.0
"""How hard it brakes for it at most."""
ALIGN_M = 15.0
"""On such a way it comes from beside the line to a third of that."""
LONGEST = 2.0
"""So many times as far as the way beside it a step leads along the line, at most."""

Pose = Tuple[float, float, float, float, float]
"""x, y, z (m), pitch, yaw (deg)."""


class LaneLine:
    """The middle of a lane and of those after it, as a line that is as long as needed.

    Where ways part it goes as straight as it can.

    Args:
        begin: ``carla.Waypoint`` at its length 0.
        then: more of them, a metre apart; the line goes on after the last.
        against: it leads against the traffic.
    """

    def __init__(self, begin: Any, then: Sequence[Any] = (), against: bool = False) -> None:
        self._against = against
        self._poses: List[Pose] = []
        self._junctions: List[bool] = []
        self._ended = False
        for place in (begin, *then):
            self._add(place)

    def pose(self, along_m: float, right_m: float = 0.0, turned_deg: float = 0.0) -> Pose:
        """Where one is after a length along it, so far to the right, turned by an angle."""
        position = along_m / SPACING_M
        while len(self._poses) < position + 2 and not self._ended:
            self._extend()
        before = min(max(int(position), 0), max(len(self._poses) - 2, 0))
        first, second = self._poses[before], self._poses[min(before + 1, len(self._poses) - 1)]
        share = position - before
        x, y, z, pitch = (a + share * (b - a) for a, b in zip(first[:4], second[:4]))
        share = min(max(share, 0.0), 1.0)
        yaw = first[4] + share * ((second[4] - first[4] + 180.0) % 360.0 - 180.0)
        side = math.radians(yaw)
        x, y = x - right_m * math.sin(side), y + right_m * math.cos(side)
        return (x, y, z, pitch, yaw + turned_deg)

    def reaches_junction(self, along_m: float) -> bool:
        """Whether it is in a junction after a length along it."""
        self.pose(along_m)
        index = min(int(along_m / SPACING_M), len(self._junctions) - 1)
        return self._junctions[index]

    def _extend(self) -> None:
        last = self._last
        following = last.previous(SPACING_M) if self._against else last.next(SPACING_M)
        if following:
            self._add(straightest(following, last))
        else:
            self._ended = True

    def _add(self, place: Any) -> None:
        self._last = place
        at, rotation = place.transform.location, place.transform.rotation
        pitch, yaw = rotation.pitch, rotation.yaw
        if self._against:
            pitch, yaw = -pitch, yaw + 180.0
        self._poses.append((at.x, at.y, at.z, pitch, yaw))
        self._junctions.append(bool(place.is_junction))


class DrivenCar:
    """A car on a line, put where it is to be in each step.

    Its velocity is set explicitly, so snapshots and sensors hold it, as in scenario ``replay``.

    Args:
        world: for the commands.
        actor: the ``carla.Vehicle``.
        line: where it drives.
        along_m: where it begins on the line.
        speed_m_s: how fast it begins.
        right_m: how far to the right of the line.

    Attributes:
        along_m: where its middle is on the line.
    """

    def __init__(
        self,
        world: Surroundings,
        actor: Any,
        line: LaneLine,
        along_m: float,
        speed_m_s: float,
        right_m: float = 0.0,
    ) -> None:
        self._world = world
        self._line = line
        self.along_m = along_m
        self._right_m = right_m
        self.actor = actor
        self.speed_m_s = speed_m_s
        self._before = line.pose(along_m - speed_m_s * world.step_s, right_m)
        actor.set_simulate_physics(False)
        self._put(line.pose(along_m, right_m))

    @property
    def pose(self) -> Pose:
        """Where the last step put it."""
        return self._before

    @property
    def place(self) -> Any:
        """``carla.Location`` where the last step put it."""
        return carla.Location(*self._before[:3])

    @property
    def half_m(self) -> float:
        """Half its length."""
        return float(self.actor.bounding_box.extent.x)

    @property
    def gap_m(self) -> float:
        """From the ego's front to its rear, along the ego's axis."""
        ahead_m, _ = self._world.from_ego(self.actor.get_location())
        return ahead_m - self.half_m - self._world.ego_half_m

    def move(self, speed_m_s: float, right_m: Optional[float] = None, lights: int = 0) -> None:
        """A step at a speed, at its end so far to the right of the line; None: nearer to it."""
        step_s = self._world.step_s
        mean_m_s = 0.5 * (self.speed_m_s + speed_m_s)
        if right_m is None:
            right_m = self._right_m * math.exp(-mean_m_s * step_s / ALIGN_M)
        self.along_m += self._along_m(mean_m_s * step_s, right_m)
        sideways_m_s = (right_m - self._right_m) / step_s
        turned_deg = math.degrees(math.atan2(sideways_m_s, max(mean_m_s, 1.0)))
        self.speed_m_s, self._right_m = speed_m_s, right_m
        self._put(self._line.pose(self.along_m, right_m, turned_deg))
        self._world.light(self.actor, lights)

    def approach(self, speed_m_s: float, rate_m_s2: float = GENTLE_M_S2) -> float:
        """Its speed after a step in which it comes nearer to another one at a rate."""
        most = rate_m_s2 * self._world.step_s
        return self.speed_m_s + min(max(speed_m_s - self.speed_m_s, -most), most)

    def keep_gap(self, gap_m: float) -> None:
        """A step in which it stays ahead of the ego at a distance."""
        self.drive(self._world.ego_speed_m_s + 0.6 * (gap_m - self.gap_m))

    def drive(self, wanted_m_s: float, right_m: Optional[float] = None, lights: int = 0) -> None:
        """A step towards a speed, slower where a car is before it."""
        speed_m_s = self.approach(max(wanted_m_s, 0.0))
        room_m = self._room_m()
        if room_m is not None:
            safe_m_s = math.sqrt(2.0 * GENTLE_M_S2 * max(room_m, 0.0))
            slowest_m_s = self.speed_m_s - HARD_M_S2 * self._world.step_s
            speed_m_s = min(speed_m_s, max(safe_m_s, slowest_m_s, 0.0))
        brakes = speed_m_s < self.speed_m_s - 1e-3
        self.move(speed_m_s, right_m, lights | (BRAKE if brakes else 0))

    @property
    def is_held_up(self) -> bool:
        """Whether a car is before it."""
        return self._room_m() is not None

    def is_before_junction(self, within_m: float) -> bool:
        """Whether its way comes to a junction soon."""
        return self._line.reaches_junction(self.along_m + within_m)

    def _along_m(self, way_m: float, right_m: float) -> float:
        """How far along the line a way beside it leads: at the inner side of a bend, farther."""
        here = self._line.pose(self.along_m, right_m)
        there = self._line.pose(self.along_m + way_m, right_m)
        led_m = math.hypot(there[0] - here[0], there[1] - here[1])
        return way_m * min(way_m / max(led_m, 1e-6), LONGEST) if way_m > 0.0 else 0.0

    def _room_m(self) -> Optional[float]:
        """How much nearer it may come to the car before it; None: there is none."""
        ahead_m = range(math.ceil(self.half_m), LOOK_M)
        spots = [self._line.pose(self.along_m + each, self._right_m)[:2] for each in ahead_m]
        first = self._world.first_taken(spots, but=self.actor)
        # A place is taken from half a lane before the other's middle, which is half a car on.
        return None if first is None else float(first) - BETWEEN_M

    def hand_over(self) -> None:
        """Let the Traffic Manager drive on."""
        yaw = math.radians(self._before[4])
        speed = self.speed_m_s
        velocity = carla.Vector3D(speed * math.cos(yaw), speed * math.sin(yaw), 0.0)
        self._world.hand_over(self.actor, velocity)

    def _put(self, pose: Pose) -> None:
        x, y, z, pitch, yaw = pose
        step_s = self._world.step_s
        velocity = [(b - a) / step_s for a, b in zip(self._before[:3], pose[:3])]
        turned = ((yaw - self._before[4] + 180.0) % 360.0 - 180.0) / step_s
        self._before = pose
        at = carla.Transform(carla.Location(x, y, z), carla.Rotation(pitch, yaw, 0.0))
        self._world.commands += [
            carla.command.ApplyTransform(self.actor.id, at),
            carla.command.ApplyTargetVelocity(self.actor.id, carla.Vector3D(*velocity)),
            carla.command.ApplyTargetAngularVelocity(
                self.actor.id, carla.Vector3D(0.0, 0.0, turned)
            ),
        ]


def straightest(places: Sequence[Any], before: Any) -> Any:
    """Of some waypoints the one whose heading is most like that of another."""
    yaw = before.transform.rotation.yaw
    return min(places, key=lambda place: _turn(place.transform.rotation.yaw, yaw))


def half_wave(share: float) -> float:
    """From 0 to 1 while ``share`` goes there, smoothly: how cars move over."""
    return 0.5 * (1.0 - math.cos(math.pi * min(max(share, 0.0), 1.0)))


def _turn(one_deg: float, other_deg: float) -> float:
    return abs((one_deg - other_deg + 180.0) % 360.0 - 180.0)
