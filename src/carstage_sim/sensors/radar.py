"""The radar: random rays in a cone, with the speed at which each hit recedes (``Radar.cpp``)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import Hits
from carstage_sim.sensors.attributes import number, require, whole, within
from carstage_sim.sensors.measurements import Detection, RadarFrame, SensorRequest
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View, turned
from carstage_sim.world.state import WorldState

_TELEPORT_SPEED = 150.0
_MOST_POINTS_PER_S = 20_000_000
_MOST_RAYS_PER_FRAME = 8_000_000

Vector = NDArray[np.float64]


class Detected(NamedTuple):
    """Rays of one tick that met something.

    Attributes:
        detections: ``(N, 4)`` float32, see :class:`RadarFrame`.
        local: ``(N, 3)`` float64 directions in the sensor's frame, 1 along its axis.
        rays: how many were sent.
        hits: what all the rays met, with ``met`` the ``(rays,)`` mask of those here.
    """

    detections: NDArray[np.float32]
    local: Vector
    rays: int
    hits: Hits
    met: NDArray[np.bool_]


class ConeOfRays(MeasuringSensor):
    """What radars share: random rays in a cone along the x axis, and how fast each hit recedes.

    Its own velocity is the way since the last tick over its duration. CARLA does not see the ticks
    that ``sensor_tick`` leaves out and overstates it there; here it is right in every frame. Before
    there is a last tick, and after a jump, the velocity of its carrier stands in.
    """

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.horizontal_fov_deg = number(a, "horizontal_fov", 30.0)
        self.vertical_fov_deg = number(a, "vertical_fov", 30.0)
        self.range_m = number(a, "range", 100.0)
        self.points_per_second = whole(a, "points_per_second", 1500)
        self.seed = whole(a, "noise_seed", 0)
        for name, fov_deg in (
            ("horizontal_fov", self.horizontal_fov_deg),
            ("vertical_fov", self.vertical_fov_deg),
        ):
            require(0.0 <= fov_deg < 180.0, f"{name} is {fov_deg}, not in [0, 180) degrees")
        require(self.range_m >= 0, "range must not be negative")
        within("points_per_second", self.points_per_second, 0, _MOST_POINTS_PER_S)
        self._before: Vector | None = None

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Remember where the radar is."""
        self._before = np.array(request.location)

    def rays(self, random: np.random.Generator, delta_s: float) -> Vector:
        """``(N, 3)`` directions in the sensor's frame whose component along the axis is 1.

        Even in radius and angle over the cone's elliptical section, and so dense at its centre.
        """
        count = min(int(self.points_per_second * delta_s), _MOST_RAYS_PER_FRAME)
        radius = random.random(count)
        angle = random.random(count) * (2.0 * math.pi)
        across = math.tan(math.radians(self.horizontal_fov_deg) / 2.0)
        up = math.tan(math.radians(self.vertical_fov_deg) / 2.0)
        return np.stack(
            [np.ones(count), across * radius * np.cos(angle), up * radius * np.sin(angle)], axis=-1
        )

    def detect(
        self, state: WorldState, request: SensorRequest, view: View, random: np.random.Generator
    ) -> Detected:
        """The rays that met something; each reaches as far as the plane at ``range``."""
        own_velocity = self._velocity(state, request)
        self.observe(state, request)
        local = self.rays(random, state.delta_s)
        count = len(local)
        directions = turned(local, request.rotation_deg)
        hits = view.rays(request.location, directions, high=self.range_m, owner_id=request.owner_id)
        met = hits.row != NOTHING
        local = local[met]
        length = np.sqrt((local**2).sum(axis=1))
        unit = directions[met].astype(np.float64) / length[:, None]
        approach = actor_velocities(state, view.actor_ids(hits)[met]) - own_velocity
        detections = np.empty((len(local), 4), np.float32)
        detections[:, Detection.VELOCITY] = (approach * unit).sum(axis=1)
        detections[:, Detection.AZIMUTH] = np.arctan2(local[:, 1], local[:, 0])
        detections[:, Detection.ALTITUDE] = np.arcsin(local[:, 2] / length)
        detections[:, Detection.DEPTH] = hits.t[met] * length
        return Detected(detections, local, count, hits, met)

    def _velocity(self, state: WorldState, request: SensorRequest) -> Vector:
        if self._before is not None and state.delta_s > 0.0:
            velocity: Vector = (np.array(request.location) - self._before) / state.delta_s
            if float(np.linalg.norm(velocity)) < _TELEPORT_SPEED:
                return velocity
        carried: Vector = actor_velocities(state, np.array([request.sensor_id]))[0]
        return carried


@SensorRegistry.register("sensor.other.radar")
class Radar(ConeOfRays):
    """CARLA's radar."""

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> RadarFrame:
        """The rays that met something."""
        random = noise_stream(self.seed, request, state)
        return RadarFrame(self.detect(state, request, view, random).detections)


def actor_velocities(state: WorldState, actor_ids: NDArray[np.integer]) -> Vector:
    """``(N, 3)`` velocities (m/s, world) of actors; 0 for ids that the frame does not have."""
    if not len(state.actor_id):
        return np.zeros((len(actor_ids), 3))
    rows = np.minimum(np.searchsorted(state.actor_id, actor_ids), len(state.actor_id) - 1)
    known = state.actor_id[rows] == actor_ids
    return np.where(known[:, None], state.velocity[rows], 0.0)
