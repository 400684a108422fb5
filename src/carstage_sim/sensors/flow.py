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
from carstage_sim.render.caster import Hits
from carstage_sim.render.gpu.camera import Product
from carstage_sim.render.motion import earlier_places
from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.lens import PINHOLE, pixel_places
from carstage_sim.sensors.measurements import FlowFrame, SensorRequest
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

_LARGEST = 2.0

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
        known = self._actors
        self._actors = _poses(state, view.frame.actor_id)
        motions = [_between(camera, before)]
        part = np.zeros(len(view.frame.actor_id), np.int32)
        for row, actor_id in enumerate(view.frame.actor_id.tolist()):
            if actor_id in known and _moved(self._actors[actor_id], known[actor_id]):
                part[row] = len(motions)
                motions.append(_between(camera, before, self._actors[actor_id], known[actor_id]))
        self._camera = camera
        turns, shifts = (np.array(of_parts) for of_parts in zip(*motions, strict=True))
        if not self.lens.distorts:
            moves = np.concatenate([turns - np.eye(3), shifts[:, :, None]], axis=2)
            of_rows = np.concatenate([moves[:1], moves[part]])
            made = view.on_card(self.camera(request), Product.FLOW, turns=of_rows)
            if made is not None:
                flow = made.view(np.float32).reshape(self.height, self.width, 2)
                return FlowFrame(self.fov_deg, flow)
        hits = view.camera(self.camera(request))
        return FlowFrame(self.fov_deg, self._flow(turns, shifts, part, hits))

    def _flow(
        self, turns: FloatArray, shifts: FloatArray, part: NDArray[np.int32], hits: Hits
    ) -> NDArray[np.float32]:
        """``(H, W, 2)`` motion of all pixels; the first three as for :func:`earlier_places`."""
        half_width = math.tan(math.radians(self.fov_deg) / 2.0)
        half_height = half_width * self.height / self.width
        places = pixel_places(self.width, self.height, self.lens)
        before = earlier_places(turns, shifts, part, hits, places, (half_width, half_height))
        x_before, y_before = before
        if self.lens.distorts:
            # The lens shows both points where it bends their rays to.
            x_before, y_before = self.lens.distorted(x_before, y_before)
        x, y = pixel_places(self.width, self.height, PINHOLE)
        flow = np.empty((self.height * self.width, 2), np.float32)
        flow[:, 0] = x - x_before
        flow[:, 1] = y_before - y
        return np.clip(flow, -_LARGEST, _LARGEST).reshape(self.height, self.width, 2)


def _moved(now: tuple[FloatArray, FloatArray], before: tuple[FloatArray, FloatArray]) -> bool:
    """Whether two poses differ."""
    return not all(np.array_equal(a, b) for a, b in zip(now, before, strict=True))


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
