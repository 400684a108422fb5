"""The rotating LiDARs: CARLA's laser geometry, intensity, drop-off, noise, semantic points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.caster import Hits
from carstage_sim.render.laser_kernels import RAYS, Lasers, aim_lasers, gather_returns
from carstage_sim.render.pixel_kernels import InParts, in_one
from carstage_sim.sensors.attributes import number, require, whole, within
from carstage_sim.sensors.lidar_kernels import write_points
from carstage_sim.sensors.measurements import (
    SEMANTIC_POINT,
    LidarFrame,
    SemanticLidarFrame,
    SensorRequest,
)
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

MOST_CHANNELS = 1024
MOST_POINTS_PER_S = 20_000_000
_MOST_RAYS_PER_FRAME = 8_000_000
FASTEST_HZ = 1000.0


def round_half_away(value: float) -> int:
    """The nearest whole number of a value >= 0, halves upwards, as ``FMath::RoundHalfFromZero``."""
    return math.floor(value + 0.5)


class Sweep(NamedTuple):
    """The rays of one tick.

    Attributes:
        per_channel: rays of each laser.
        azimuth_rad: ``(per_channel,)`` float64, positive to the right.
        end_angle_deg: angle of the head when the tick ends.
    """

    per_channel: int
    azimuth_rad: NDArray[np.float64]
    end_angle_deg: float


@dataclass(frozen=True, slots=True)
class LidarGeometry:
    """The lasers of a LiDAR (attributes of ``sensor.lidar.ray_cast``)."""

    channels: int
    points_per_second: float
    rotation_frequency_hz: float
    upper_fov_deg: float
    lower_fov_deg: float
    horizontal_fov_deg: float

    @property
    def elevation_rad(self) -> NDArray[np.float64]:
        """``(channels,)`` elevation of each laser, evenly spaced, top first."""
        if self.channels == 1:
            return np.radians([self.upper_fov_deg])
        step = (self.upper_fov_deg - self.lower_fov_deg) / (self.channels - 1)
        angles: NDArray[np.float64] = np.radians(
            self.upper_fov_deg - np.arange(self.channels) * step
        )
        return angles

    def sweep(self, start_angle_deg: float, delta_s: float) -> Sweep:
        """Rays of a tick of ``delta_s`` seconds that begins at ``start_angle_deg``.

        CARLA's ``RayCastLidar.cpp``: as many rays per laser as ``points_per_second`` allows,
        azimuths in equal steps from the start angle, folded into the field of view. A tick so long
        that this machine could not hold the rays has eight million.
        """
        wanted = round_half_away(self.points_per_second * delta_s / self.channels)
        per_channel = min(wanted, _MOST_RAYS_PER_FRAME // self.channels)
        advance = self.rotation_frequency_hz * self.horizontal_fov_deg * delta_s
        step = advance / per_channel if per_channel else 0.0
        angles = np.fmod(start_angle_deg + np.arange(per_channel) * step, self.horizontal_fov_deg)
        return Sweep(
            per_channel,
            np.radians(angles - self.horizontal_fov_deg / 2.0),
            math.fmod(start_angle_deg + advance, self.horizontal_fov_deg),
        )


def laser_directions(
    elevation_rad: NDArray[np.float64], azimuth_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """``(channels * rays, 3)`` unit directions in the sensor's frame, channel after channel."""
    level = np.cos(elevation_rad)[:, None]
    rays = np.empty((len(elevation_rad), len(azimuth_rad), 3))
    rays[..., 0] = level * np.cos(azimuth_rad)
    rays[..., 1] = level * np.sin(azimuth_rad)
    rays[..., 2] = np.sin(elevation_rad)[:, None]
    return rays.reshape(-1, 3)


class Returns(NamedTuple):
    """Rays of one tick that met something.

    Attributes:
        local: ``(N, 3)`` float64 unit directions in the sensor's frame.
        channel: ``(N,)`` laser of each ray, ascending.
        distance_m: ``(N,)`` float64.
        hits: what all the rays that were sent met, with ``met`` the ``(M,)`` mask of those here.
    """

    local: NDArray[np.float64]
    channel: NDArray[np.intp]
    distance_m: NDArray[np.float64]
    hits: Hits
    met: NDArray[np.bool_]


def warm_up(in_parts: InParts = in_one) -> None:
    """Compile, or load, what aims lasers and puts a frame together."""
    local, channel, many = np.zeros((1, 3)), np.zeros(1, np.intp), np.zeros(1)
    flags, row, t = np.ones(1, np.bool_), np.zeros(1, np.int32), np.zeros(1, np.float32)
    lasers = Lasers(many, many, many, many, channel)
    in_parts(aim_lasers, (lasers, np.eye(3), np.zeros((1, 3), np.float32)), 1)
    places = np.zeros(2, np.int64)
    in_parts(gather_returns, (lasers, row, t, flags, places, local, channel, many), 1)
    write_points(
        local, channel, many, many, flags, np.zeros((1, 4), np.float32), np.zeros(1, np.uint32)
    )


class RotatingLidar(MeasuringSensor):
    """What both LiDARs share: lasers on a head that goes on turning between frames.

    As in ``RayCastSemanticLidar.cpp`` a head may stand still or turn the other way, and without
    points or range there are frames without points.
    """

    beside_others = True
    many_steps = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.geometry = LidarGeometry(
            channels=whole(a, "channels", 32),
            points_per_second=number(a, "points_per_second", 56000),
            rotation_frequency_hz=number(a, "rotation_frequency", 10.0),
            upper_fov_deg=number(a, "upper_fov", 10.0),
            lower_fov_deg=number(a, "lower_fov", -30.0),
            horizontal_fov_deg=number(a, "horizontal_fov", 360.0),
        )
        self.range_m = number(a, "range", 10.0)
        within("channels", self.geometry.channels, 1, MOST_CHANNELS)
        within("points_per_second", self.geometry.points_per_second, 0, MOST_POINTS_PER_S)
        turns_hz = self.geometry.rotation_frequency_hz
        within("rotation_frequency", turns_hz, -FASTEST_HZ, FASTEST_HZ)
        for name, angle_deg in (
            ("upper_fov", self.geometry.upper_fov_deg),
            ("lower_fov", self.geometry.lower_fov_deg),
        ):
            within(name, angle_deg, -90, 90)
        require(0 < self.geometry.horizontal_fov_deg <= 360, "horizontal_fov must be in (0, 360]")
        require(self.range_m >= 0, "range must not be negative")
        self._angle_deg = 0.0
        self._turned_s = 0.0

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Let the time of a tick without a frame count for the next one."""
        self._turned_s += state.delta_s

    def turn(self, state: WorldState) -> Sweep:
        """The rays of the time since the last frame; the head stands where they end."""
        sweep = self.geometry.sweep(self._angle_deg, state.delta_s + self._turned_s)
        self._angle_deg = sweep.end_angle_deg
        self._turned_s = 0.0
        return sweep

    def shoot(
        self,
        sweep: Sweep,
        request: SensorRequest,
        view: View,
        fired: NDArray[np.bool_] | None = None,
    ) -> Returns:
        """Send the rays of a sweep, or those that ``fired``, into one frozen scene."""
        up, around = self.geometry.elevation_rad, sweep.azimuth_rad
        sent = np.empty(0, np.intp) if fired is None else np.flatnonzero(fired)
        count = self.geometry.channels * sweep.per_channel if fired is None else len(sent)
        lasers = Lasers(np.cos(up), np.sin(up), np.cos(around), np.sin(around), sent)
        rotation = np.ascontiguousarray(rotation_matrix(request.rotation_deg))
        world = np.empty((count, 3), np.float32)
        view.in_parts(aim_lasers, (lasers, rotation, world), count, RAYS)
        hits = view.rays(request.location, world, high=self.range_m, owner_id=request.owner_id)
        met, places = np.empty(count, np.bool_), np.zeros(count // RAYS + 2, np.int64)
        local, channel, distance = np.empty((count, 3)), np.empty(count, np.intp), np.empty(count)
        gathering = lasers, hits.row, hits.t, met, places, local, channel, distance
        view.in_parts(gather_returns, gathering, count, RAYS)
        back = int(places[-1])
        return Returns(local[:back], channel[:back], distance[:back], hits, met)

    def counts(self, channel: NDArray[np.intp]) -> NDArray[np.uint32]:
        """Points of each laser."""
        return np.bincount(channel, minlength=self.geometry.channels).astype(np.uint32)


@SensorRegistry.register("sensor.lidar.ray_cast")
class RayCastLidar(RotatingLidar):
    """Points and their intensity, with drop-off and noise along the ray."""

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.attenuation_per_m = number(a, "atmosphere_attenuation_rate", 0.004)
        self.dropoff_rate = number(a, "dropoff_general_rate", 0.45)
        self.dropoff_limit = number(a, "dropoff_intensity_limit", 0.8)
        self.dropoff_at_zero = number(a, "dropoff_zero_intensity", 0.4)
        self.noise_m = number(a, "noise_stddev", 0.0)
        self.seed = whole(a, "noise_seed", 0)
        require(self.noise_m >= 0, "noise_stddev must not be negative")

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> LidarFrame:
        """The points of the time since the last frame, all of one frozen scene."""
        sweep = self.turn(state)
        random = noise_stream(self.seed, request, state)
        fired = None
        if self.dropoff_rate > 0:
            count = self.geometry.channels * sweep.per_channel
            fired = random.random(count) >= self.dropoff_rate
        local, channel, distance, *_ = self.shoot(sweep, request, view, fired)
        intensity = np.exp(-self.attenuation_per_m * distance)
        if self.noise_m > 0:
            distance = distance + random.normal(0.0, self.noise_m, len(distance))
        kept = self._kept(intensity, random)
        points = np.empty((np.count_nonzero(kept), 4), np.float32)
        counts = np.zeros(self.geometry.channels, np.uint32)
        write_points(local, channel, distance, intensity, kept, points, counts)
        return LidarFrame(math.radians(sweep.end_angle_deg), counts, points)

    def _kept(
        self, intensity: NDArray[np.float64], random: np.random.Generator
    ) -> NDArray[np.bool_]:
        """Which returns are strong enough: all above the limit, others by chance."""
        if self.dropoff_at_zero <= 0 or self.dropoff_limit <= 0:
            return np.ones(len(intensity), np.bool_)
        chance = self.dropoff_at_zero / self.dropoff_limit * intensity + 1.0 - self.dropoff_at_zero
        drawn = random.random(len(intensity))
        kept: NDArray[np.bool_] = (intensity > self.dropoff_limit) | (drawn < chance)
        return kept


@SensorRegistry.register("sensor.lidar.ray_cast_semantic")
class SemanticLidar(RotatingLidar):
    """Every point with what it lies on, no losses, no noise (``RayCastSemanticLidar.cpp``)."""

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> SemanticLidarFrame:
        """Points, cosine of the angle of incidence, actor id (0 for the town), semantic tag."""
        sweep = self.turn(state)
        local, channel, distance, hits, met = self.shoot(sweep, request, view)
        points = np.empty(len(local), SEMANTIC_POINT)
        for axis, name in enumerate("xyz"):
            points[name] = local[:, axis] * distance
        normals = view.flat_normals(hits)[met]
        points["cos_inc_angle"] = np.abs(np.einsum("ij,ij->i", normals, hits.directions[met]))
        points["object_idx"] = view.actor_ids(hits)[met]
        points["object_tag"] = view.tags(hits)[met]
        return SemanticLidarFrame(math.radians(sweep.end_angle_deg), self.counts(channel), points)
