"""A LiDAR that CARLA has not: every point is measured at its own instant of the sweep.

CARLA's LiDARs see one frozen scene in a tick. Here the head turns, the sensor moves and the actors
move while the rays of a tick are sent, as with a real one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.cast import NOTHING, Scene
from carstage_sim.render.scene import Frame
from carstage_sim.sensors.lidar import RayCastLidar, laser_directions
from carstage_sim.sensors.loose_wheels import turned
from carstage_sim.sensors.measurements import SEMANTIC_POINT, SemanticLidarFrame, SensorRequest
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.radar import actor_velocities
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

TYPE_ID: Final = "sensor.lidar.ray_cast_sweeping"
_STEP_M: Final = 0.02
"""How far an actor moves between two instants that rays are sent at, unless they were too many."""
_MOST_INSTANTS: Final = 200
"""Each costs a hierarchy of all actors: a client sets one at a speed or a turn of its choice."""
_JUMP_M_S: Final = 150.0
"""What is faster was put elsewhere, and did not move there."""
_HALF_TURN: Final = 1e-3
_MICROSECOND: Final = 1e-6

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SweepMotion:
    """The sensor's even motion over a sweep, in its own axes at the sweep's end.

    Attributes:
        velocity: ``(3,)`` m/s.
        turning: ``(3,)`` rad/s about each axis: half of it times an age is the Gibbs vector of the
            rotation in that time (Rodrigues 1840), so rotations need sums and products alone.
    """

    velocity: Vector
    turning: Vector

    @classmethod
    def between(cls, before: Moment, now: Moment, span_s: float) -> SweepMotion:
        """From pose to pose; none where the sensor was put elsewhere."""
        turned = _in_axes(before.rotation, now.rotation)
        trace = 1.0 + float(turned[0, 0] + turned[1, 1] + turned[2, 2])
        way = (now.location - before.location)[:, None]
        velocity = _in_axes(way, now.rotation)[0] / span_s
        if trace < _HALF_TURN or float(np.sqrt((velocity**2).sum())) > _JUMP_M_S:
            return cls(np.zeros(3), np.zeros(3))
        across = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        gibbs = (across - [turned[1, 2], turned[2, 0], turned[0, 1]]) / trace
        # As a client gets them, so that it can undo the motion exactly.
        single = np.concatenate([velocity, 2.0 * gibbs / span_s]).astype(np.float32)
        return cls(*single.astype(np.float64).reshape(2, 3))

    def origins(self, age_s: Vector) -> Vector:
        """``(N, 3)`` where the sensor was, so long before the sweep's end."""
        return -self.velocity * age_s[:, None]

    def turned(self, vectors: Vector, age_s: Vector) -> Vector:
        """``(N, 3)`` vectors of the sensor's axes at their ages, in the axes at the end."""
        gibbs = -0.5 * self.turning * age_s[:, None]
        square = (gibbs**2).sum(axis=1)[:, None]
        once = np.cross(gibbs, vectors)
        return np.asarray(vectors + 2.0 / (1.0 + square) * (once + np.cross(gibbs, once)))


@dataclass(frozen=True, slots=True)
class Moment:
    """A tick: the sensor's pose in the world and everybody's."""

    location: Vector
    rotation: Vector
    state: WorldState


@SensorRegistry.register(TYPE_ID)
class SweepingLidar(RayCastLidar):
    """Attributes, intensity, drop-off and noise of ``sensor.lidar.ray_cast``.

    Sensor and actors move evenly from their last poses to those of this tick. Before there is a
    last tick, their velocities say where they were. The data are those of a semantic LiDAR: x, y, z
    in the sensor's axes at the point's instant, intensity, its age at the end of the tick in
    microseconds, number of the laser. One more channel has one point, the sensor's motion: its
    velocity (m/s) and turning (rad/s) are the six numbers, as float32.
    """

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self._before: Moment | None = None

    def measure(  # type: ignore[override]  # it sends what a semantic LiDAR does
        self, state: WorldState, request: SensorRequest, view: View
    ) -> SemanticLidarFrame:
        """The points of the time since the last frame, each of its own instant."""
        span_s = state.delta_s + self._turned_s
        sweep = self.turn(state)
        now = Moment(np.array(request.location), rotation_matrix(request.rotation_deg), state)
        before = self._before or _backwards(now, request.sensor_id, span_s)
        self._before = now
        motion = SweepMotion.between(before, now, span_s)
        age_us = np.rint(span_s / _MICROSECOND * (1.0 - _parts(sweep.per_channel)))
        channels = self.geometry.channels
        column = np.tile(np.arange(sweep.per_channel), channels)
        channel = np.repeat(np.arange(channels), sweep.per_channel)
        local = laser_directions(self.geometry.elevation_rad, sweep.azimuth_rad)
        random = noise_stream(self.seed, request, state)
        if self.dropoff_rate > 0:
            fired = random.random(len(local)) >= self.dropoff_rate
            local, channel, column = local[fired], channel[fired], column[fired]
        age_s = (age_us * _MICROSECOND)[column]
        starts = _in_world(motion.origins(age_s), now.rotation) + now.location
        rays = _in_world(motion.turned(local, age_s), now.rotation)
        scenes = _Scenes(view.frame, before.state, state, span_s)
        skip_row = view.skipped_row(request.owner_id, request.location)
        distance = scenes.distances(view, starts, rays, age_s, self.range_m, skip_row)
        met = np.isfinite(distance)
        local, channel, distance = local[met], channel[met], distance[met]
        intensity = np.exp(-self.attenuation_per_m * distance)
        if self.noise_m > 0:
            distance = distance + random.normal(0.0, self.noise_m, len(distance))
        kept = self._kept(intensity, random)
        points = np.zeros(int(kept.sum()) + 1, SEMANTIC_POINT)
        for axis, name in enumerate("xyz"):
            points[name][:-1] = (local[:, axis] * distance)[kept]
        points["cos_inc_angle"][:-1] = intensity[kept]
        points["object_idx"][:-1] = age_us[column[met][kept]]
        points["object_tag"][:-1] = channel[kept]
        points[-1:].view(np.float32)[:] = np.concatenate([motion.velocity, motion.turning])
        counts = np.append(self.counts(channel[kept]), np.uint32(1))
        return SemanticLidarFrame(math.radians(sweep.end_angle_deg), counts, points)


def _parts(count: int) -> Vector:
    """Parts of a sweep after which each of its columns is measured."""
    return np.arange(count) / max(count, 1)


def _backwards(now: Moment, sensor_id: int, span_s: float) -> Moment:
    """Where everybody was a sweep ago, if they moved evenly and did not turn."""
    state = now.state
    velocity = actor_velocities(state, np.array([sensor_id]))[0]
    return Moment(now.location - velocity * span_s, now.rotation, state)


def _in_axes(columns: Vector, rotation: Vector) -> Vector:
    """``(N, 3)`` of ``(3, N)`` vectors in a rotation's axes; sums written out, as below."""
    parts = columns[:, :, None] * rotation[:, None, :]
    return np.asarray(parts[0] + parts[1] + parts[2])


def _in_world(vectors: Vector, rotation: Vector) -> Vector:
    """Vectors of the sensor's axes at the end; sums written out, the same on every machine."""
    axes = [
        vectors[:, 0] * rotation[axis, 0]
        + vectors[:, 1] * rotation[axis, 1]
        + vectors[:, 2] * rotation[axis, 2]
        for axis in range(3)
    ]
    return np.stack(axes, axis=1)


class _Scenes:
    """The scene at instants of a sweep: actors on straight ways, with their shape at its end.

    Args:
        frame: the scene at the end.
        before, state: the world when the sweep began and ended; the same: velocities tell.
        span_s: the sweep's duration.
    """

    def __init__(self, frame: Frame, before: WorldState, state: WorldState, span_s: float) -> None:
        self._frame, self._span_s = frame, span_s
        here, is_here = _rows(state, frame.actor_id)
        there, was_there = _rows(before, frame.actor_id)
        known = is_here & was_there
        count = len(frame.actor_id)
        self._location, self._rotation_deg = np.zeros((count, 3)), np.zeros((count, 3))
        self._way, self._turn_deg = np.zeros((count, 3)), np.zeros((count, 3))
        self._wheels = np.empty(0, np.intp)
        if not count or not known.any():
            return
        self._location, self._rotation_deg = state.location[here], state.rotation_deg[here]
        (self._wheels,) = np.nonzero(frame.body != np.arange(count))
        if before is state:
            self._way = state.velocity[here] * span_s
        else:
            self._way = self._location - before.location[there]
            turn = self._rotation_deg - before.rotation_deg[there]
            self._turn_deg = np.remainder(turn + 180.0, 360.0) - 180.0
        stays = ~known | (np.sqrt((self._way**2).sum(axis=1)) > _JUMP_M_S * span_s)
        self._way[stays], self._turn_deg[stays] = 0.0, 0.0

    def distances(
        self,
        view: View,
        starts: Vector,
        rays: Vector,
        age_s: Vector,
        range_m: float,
        skip_row: int,
    ) -> Vector:
        """``(N,)`` where rays of unit length first meet anything at their ages, or infinity."""
        found = np.full(len(rays), np.inf)
        instants = self._instants(skip_row)
        part = age_s / self._span_s
        number = np.minimum((part * instants).astype(np.intp), instants - 1)
        order = np.argsort(number, kind="stable")
        ends = np.searchsorted(number[order], np.arange(instants + 1))
        for instant in range(instants):
            some = order[ends[instant] : ends[instant + 1]]
            if not len(some):
                continue
            scene = None if instants == 1 else self._at(float(part[some].mean()))
            hits = view.bundle(
                starts[some], rays[some], high_m=range_m, skip_row=skip_row, scene=scene
            )
            found[some] = np.where(hits.row != NOTHING, hits.t.astype(np.float64), np.inf)
        return found

    def _instants(self, skip_row: int) -> int:
        """How many of them there are, so that nobody moves far in between."""
        reach_m = np.abs(self._frame.bounds).max(axis=(1, 2), initial=0.0)
        way_m = np.sqrt((self._way**2).sum(axis=1))
        way_m += np.radians(np.sqrt((self._turn_deg**2).sum(axis=1))) * reach_m
        if skip_row >= 0:
            way_m[self._frame.body == skip_row] = 0.0
        wanted = math.ceil(float(way_m.max(initial=0.0)) / _STEP_M)
        return min(max(1, wanted), _MOST_INSTANTS)

    def _at(self, part: float) -> Scene:
        """The scene when that part of the sweep was still to come."""
        rotation = rotation_matrix(self._rotation_deg - self._turn_deg * part).reshape(-1, 3, 3)
        position = self._location - self._way * part
        wheels, frame = self._wheels, self._frame
        if len(wheels):  # they go along with their vehicles
            now = rotation_matrix(self._rotation_deg[wheels])
            moved = turned(rotation[wheels], np.swapaxes(now, 1, 2))
            position[wheels] += turned(moved, frame.location[wheels] - self._location[wheels])
            rotation[wheels] = turned(moved, frame.rotation[wheels])
        return self._frame.moved(rotation.astype(np.float32), position.astype(np.float32))


def _rows(
    state: WorldState, actor_id: NDArray[np.uint32]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Row of each actor in a state, and whether it has one."""
    if not len(state.actor_id):
        return np.zeros(len(actor_id), np.intp), np.zeros(len(actor_id), np.bool_)
    rows = np.minimum(np.searchsorted(state.actor_id, actor_id), len(state.actor_id) - 1)
    return rows, state.actor_id[rows] == actor_id
