"""The obstacle detector: a ball that goes ahead of the sensor until it touches something."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.cast import NOTHING, Scene
from carstage_sim.render.scene import Frame
from carstage_sim.sensors.attributes import flag, number, require
from carstage_sim.sensors.measurements import ObstacleFrame, SensorRequest
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import ActorKind, WorldState

_RINGS = 5
_FEELERS = 80
_DYNAMIC = (ActorKind.VEHICLE, ActorKind.WALKER)


def ball_rays(radius_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parallel rays that stand for a ball: ``(N, 2)`` offsets across, ``(N,)`` half thickness.

    Rings of 6, 12, 18 ... rays, a fifth of the radius apart: what is thinner may slip through.
    """
    offsets = [(0.0, 0.0)]
    for ring in range(1, _RINGS + 1) if radius_m > 0 else ():
        for place in range(6 * ring):
            angle = place * math.pi / (3 * ring)
            offsets.append((math.cos(angle) * ring / _RINGS, math.sin(angle) * ring / _RINGS))
    across = np.array(offsets)
    half = np.sqrt(np.maximum(1.0 - (across**2).sum(axis=1), 0.0))
    return across * radius_m, half * radius_m


def feelers() -> NDArray[np.float64]:
    """``(80, 3)`` unit vectors, evenly over the sphere along a golden spiral."""
    height = 1.0 - (2.0 * np.arange(_FEELERS) + 1.0) / _FEELERS
    turn = np.arange(_FEELERS) * (math.pi * (3.0 - math.sqrt(5.0)))
    ring = np.sqrt(1.0 - height**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=-1)


@SensorRegistry.register("sensor.other.obstacle")
class ObstacleDetector(MeasuringSensor):
    """An event in every tick in which something is in the way (``ObstacleDetectionSensor.cpp``).

    What the ball holds from the start, such as the road under a low sensor, is in the way at once.
    What carries the sensor never is. With ``only_dynamics`` nothing but vehicles and walkers is.
    """

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.distance_m = number(request.attributes, "distance", 5.0)
        self.radius_m = number(request.attributes, "hit_radius", 0.5)
        self.only_dynamics = flag(request.attributes, "only_dynamics", default=False)
        require(self.distance_m >= 0, "distance must not be negative")
        require(self.radius_m >= 0, "hit_radius must not be negative")
        self._across, self._half = ball_rays(self.radius_m)

    def measure(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> ObstacleFrame | None:
        """The nearest thing, if there is one."""
        rotation = rotation_matrix(request.rotation_deg)
        centre = np.array(request.location)
        forward, right, up = rotation.T
        # Rays ahead begin at the back of the ball; feelers find what lies along its way.
        behind = (
            self._across[:, :1] * right + self._across[:, 1:] * up - self._half[:, None] * forward
        )
        held = feelers()
        hits = view.bundle(
            centre + np.concatenate([behind, np.zeros_like(held)]),
            np.concatenate([np.tile(forward, (len(behind), 1)), held]),
            high_m=self.distance_m + 2.0 * self.radius_m,
            scene=self._scene(state, request.owner_id, view.frame),
        )
        ahead, around = hits.t[: len(behind)], hits.t[len(behind) :]
        way = np.concatenate(
            [
                np.maximum(ahead - 2.0 * self._half, 0.0),
                np.where(around < self.radius_m, 0.0, np.inf),
            ]
        )
        way[hits.row == NOTHING] = np.inf
        nearest = int(way.argmin())
        if way[nearest] > self.distance_m:
            return None
        other_id = int(view.actor_ids(hits)[nearest])
        label = 0 if other_id else int(view.tags(hits)[nearest])
        return ObstacleFrame(request.sensor_id, other_id, label, float(way[nearest]))

    def _scene(self, state: WorldState, owner_id: int, frame: Frame) -> Scene:
        """What can be in the way."""
        if not self.only_dynamics:
            return frame.without(frozenset((owner_id,))).scene
        kinds = state.kind[np.searchsorted(state.actor_id, frame.actor_id)]
        return frame.only(np.isin(kinds, _DYNAMIC) & (frame.actor_id != owner_id))
