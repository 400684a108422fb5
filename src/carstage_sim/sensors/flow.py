"""The optical-flow camera: how far each surface point moved across the picture.

The value is CARLA's: current minus previous position in the picture, in units of half its width
and height, y upwards, within [-2, 2]. In pixels, with y downwards, the motion is
``(x * width / 2, -y * height / 2)``. Unlike CARLA's, which come from a 16-bit target, the values
are not quantised.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.cast import NOTHING
from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.frames import FlowFrame, SensorRequest
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

_LARGEST = 2.0
_BEHIND = 1e-9
"""Stands for the depth of what was behind the camera: its motion ends at the largest value."""

FloatArray = NDArray[np.float64]


@SensorRegistry.register("sensor.camera.optical_flow")
class OpticalFlowCamera(CameraSensor):
    """Motion since this camera's last picture; 0 in its first.

    What is rigid moves as its actor does: legs and wheels have no motion of their own. An actor
    that was not there before has not moved. The sky is infinitely far away.
    """

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self._camera: tuple[FloatArray, FloatArray] | None = None
        self._actors: dict[int, tuple[FloatArray, FloatArray]] = {}

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> FlowFrame:
        """The motion of each pixel's surface point."""
        camera = (rotation_matrix(request.rotation_deg), np.array(request.location, np.float64))
        before = self._camera if self._camera is not None else camera
        hits = view.camera(self.camera(request))
        inverse_depth = 1.0 / hits.t.astype(np.float64)
        inverse_depth[hits.row == NOTHING] = 0.0
        flow = np.empty((self.height * self.width, 2), np.float32)
        self._project(*_between(camera, before), inverse_depth, slice(None), flow)
        known = self._actors
        self._actors = _poses(state, view.frame.actor_id)
        (seen,) = np.nonzero(hits.row >= 0)
        for row in np.unique(hits.row[seen]).tolist():
            actor_id = int(view.frame.actor_id[row])
            if actor_id in known:
                pixels = seen[hits.row[seen] == row]
                motion = _between(camera, before, self._actors[actor_id], known[actor_id])
                self._project(*motion, inverse_depth[pixels], pixels, flow)
        self._camera = camera
        return FlowFrame(self.fov_deg, flow.reshape(self.height, self.width, 2))

    def _project(
        self,
        turn: FloatArray,
        shift: FloatArray,
        inverse_depth: FloatArray,
        pixels: slice | NDArray[np.intp],
        flow: NDArray[np.float32],
    ) -> None:
        """Write the motion of some pixels whose points ``p`` were at ``turn @ p + shift``.

        Both in camera axes (forward, right, up). Divided by its depth, a point is ``(1, a, b)``
        with the slopes of its pixel's ray, and the shift is divided by the depth.
        """
        half_width = math.tan(math.radians(self.fov_deg) / 2.0)
        half_height = half_width * self.height / self.width
        across = ((np.arange(self.width) + 0.5) * (2.0 / self.width) - 1.0) * half_width
        upwards = (1.0 - (np.arange(self.height) + 0.5) * (2.0 / self.height)) * half_height
        right = np.tile(across, self.height)[pixels]
        up = np.repeat(upwards, self.width)[pixels]
        forward_before, right_before, up_before = (
            turn[axis, 0] + turn[axis, 1] * right + turn[axis, 2] * up + shift[axis] * inverse_depth
            for axis in range(3)
        )
        forward_before = np.maximum(forward_before, _BEHIND)
        flow[pixels, 0] = np.clip(
            (right - right_before / forward_before) / half_width, -_LARGEST, _LARGEST
        )
        flow[pixels, 1] = np.clip(
            (up - up_before / forward_before) / half_height, -_LARGEST, _LARGEST
        )


def _between(
    camera: tuple[FloatArray, FloatArray],
    camera_before: tuple[FloatArray, FloatArray],
    actor: tuple[FloatArray, FloatArray] | None = None,
    actor_before: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Rotation and shift that take a point from today's camera axes to those of before.

    Each argument is a rotation ``world_from_local`` and an origin. Without an actor the point stood
    still in the world.
    """
    turn, place = camera
    if actor is not None and actor_before is not None:
        moved = actor_before[0] @ actor[0].T
        turn, place = moved @ turn, moved @ (place - actor[1]) + actor_before[1]
    return camera_before[0].T @ turn, camera_before[0].T @ (place - camera_before[1])


def _poses(
    state: WorldState, actor_ids: NDArray[np.uint32]
) -> dict[int, tuple[FloatArray, FloatArray]]:
    rows = np.searchsorted(state.actor_id, actor_ids)
    rotations = rotation_matrix(state.rotation_deg[rows].reshape(-1, 3))
    return {
        actor_id: (rotations[index], state.location[row])
        for index, (actor_id, row) in enumerate(zip(actor_ids.tolist(), rows, strict=True))
    }
