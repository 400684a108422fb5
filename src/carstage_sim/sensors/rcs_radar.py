"""A radar that CARLA has not: its detections have radar cross sections."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.sensors.attributes import flag
from carstage_sim.sensors.measurements import (
    SEMANTIC_POINT,
    Detection,
    SemanticLidarFrame,
    SensorRequest,
)
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.radar import ConeOfRays, Detected
from carstage_sim.sensors.radar_cross_section import (
    NARROW_M,
    PERSON_DBSM,
    PERSON_DEVIATION_DB,
    VEHICLE_DEVIATION_DB,
    clutter_dbsm,
    fluctuation_db,
    vehicle_dbsm,
)
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import ActorKind, WorldState

TYPE_ID: Final = "sensor.other.radar_rcs"

Vector = NDArray[np.float64]


@SensorRegistry.register(TYPE_ID)
class RcsRadar(ConeOfRays):
    """Attributes and rays of ``sensor.other.radar``, and an RCS for each detection.

    All detections of a vehicle or a person in a tick have the RCS of the whole of it. With
    ``fluctuation`` it changes from tick to tick. Detections of all else have that of the surface
    which their ray stands for. The data are those of a semantic LiDAR with one channel. Of a
    point x, y, z and ``cos_inc_angle`` are velocity, azimuth, altitude and depth. The bits of
    ``object_idx`` and ``object_tag`` are float32: RCS (dBsm) and semantic tag.
    """

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.fluctuates = flag(request.attributes, "fluctuation", default=True)

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> SemanticLidarFrame:
        """The rays that met something."""
        random = noise_stream(self.seed, request, state)
        found = self.detect(state, request, view, random)
        normal = random.standard_normal(len(view.frame.actor_id))
        tags = view.tags(found.hits)[found.met]
        rows = np.empty((len(found.detections), 6), np.float32)
        rows[:, : len(Detection)] = found.detections
        rows[:, 4] = self._cross_sections(state, request, view, found, tags, normal)
        rows[:, 5] = tags
        points = rows.view(SEMANTIC_POINT).reshape(-1)
        return SemanticLidarFrame(0.0, np.array([len(points)], np.uint32), points)

    def solid_angles(self, local: Vector, rays: int) -> Vector:
        """``(N,)`` sr that each of so many rays stands for; they lie closer at the axis.

        A ray at the part r of the ellipse's radius stands for ``2 pi a b r / rays`` of the plane at
        distance 1, ``a`` and ``b`` being the ellipse's half axes.
        """
        a = math.tan(math.radians(self.horizontal_fov_deg) / 2.0)
        b = math.tan(math.radians(self.vertical_fov_deg) / 2.0)
        if a <= 0.0 or b <= 0.0:
            return np.zeros(len(local))
        radius = np.sqrt((local[:, 1] / a) ** 2 + (local[:, 2] / b) ** 2)
        length = np.sqrt((local**2).sum(axis=1))
        return np.asarray(2.0 * math.pi * a * b * radius / (rays * length**3))

    def _cross_sections(
        self,
        state: WorldState,
        request: SensorRequest,
        view: View,
        found: Detected,
        tags: NDArray[np.uint8],
        normal: Vector,
    ) -> Vector:
        """``(N,)`` dBsm of the detections; ``normal`` has a number for each row of the scene."""
        depth = found.detections[:, Detection.DEPTH].astype(np.float64)
        rcs = clutter_dbsm(tags, self.solid_angles(found.local, found.rays), depth)
        row = found.hits.row[found.met]
        of_actor = row >= 0
        if not of_actor.any():
            return rcs
        row = np.where(of_actor, view.frame.body[row], row)  # a vehicle's wheels are its own
        of_rows, is_target, deviation = _of_rows(state, request, view)
        if self.fluctuates:
            of_rows = of_rows + fluctuation_db(normal, deviation)
        target = of_actor & is_target[row]
        rcs[target] = of_rows[row[target]]
        return rcs


def _of_rows(
    state: WorldState, request: SensorRequest, view: View
) -> tuple[Vector, NDArray[np.bool_], Vector]:
    """Mean RCS of each row of the scene, whether it is a vehicle or a person, its deviation."""
    frame = view.frame
    low, high = frame.bounds[:, 0].astype(np.float64), frame.bounds[:, 1].astype(np.float64)
    away = np.array(request.location) - frame.scene.position.astype(np.float64)
    rotation = frame.scene.rotation.astype(np.float64)
    # In the actor's axes; sums written out, the same on every machine.
    local = (
        rotation[:, 0, :] * away[:, :1]
        + rotation[:, 1, :] * away[:, 1:2]
        + rotation[:, 2, :] * away[:, 2:]
    )
    local -= (low + high) / 2.0
    towards = local / np.maximum(np.sqrt((local**2).sum(axis=1)), 1e-9)[:, None]
    kind = _kinds(state, frame.actor_id)
    size = high - low
    is_vehicle = kind == ActorKind.VEHICLE
    wide = is_vehicle & (size[:, 1] >= NARROW_M)
    rcs = np.where(is_vehicle, vehicle_dbsm(towards, size), PERSON_DBSM)
    deviation = np.where(wide, VEHICLE_DEVIATION_DB, PERSON_DEVIATION_DB)
    return rcs, is_vehicle | (kind == ActorKind.WALKER), deviation


def _kinds(state: WorldState, actor_id: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """Kind of each row's actor; 255 for those that the world does not have."""
    if not len(state.actor_id):
        return np.full(len(actor_id), 255, np.uint8)
    rows = np.minimum(np.searchsorted(state.actor_id, actor_id), len(state.actor_id) - 1)
    return np.where(state.actor_id[rows] == actor_id, state.kind[rows], 255).astype(np.uint8)
