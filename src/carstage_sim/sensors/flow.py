"""The optical-flow camera: how far each surface point moved across the picture.

The value is CARLA's: current minus previous position in the picture, in units of half its width
and height, y upwards, within [-2, 2]. In pixels, with y downwards, the motion is
``(x * width / 2, -y * height / 2)``. Unlike CARLA's, which come from a 16-bit target, the values
are not quantised.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.caster import Hits
from carstage_sim.render.gpu.camera import Product
from carstage_sim.render.motion import LARGEST, RIGID, Motions, flow_of_motions
from carstage_sim.render.scene import Frame
from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.lens import PINHOLE, pixel_places
from carstage_sim.sensors.measurements import FlowFrame, SensorRequest
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import ActorKind, WorldState

_BAND = 1 << 16
"""Pixels that a thread bends at a time."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Where an actor was.

    Attributes:
        rotation: ``(3, 3)`` world_from_actor.
        location: ``(3,)`` world metres.
        figure: ``(T, 3, 3)`` corners of a walker's triangles in its frame; None of what is rigid.
    """

    rotation: FloatArray
    location: FloatArray
    figure: NDArray[np.float32] | None

    def is_as(self, before: _Seen) -> bool:
        """Whether nothing of it has moved."""
        return np.array_equal(self.rotation, before.rotation) and np.array_equal(
            self.location, before.location
        )

    def bent_from(self, before: _Seen) -> NDArray[np.float32] | None:
        """``(T, 3, 3)`` what to add to a figure's corners for its pose of before; None: nothing."""
        now, then = self.figure, before.figure
        if now is None or then is None or now is then or len(now) != len(then):
            return None
        change: NDArray[np.float32] = then - now
        return change


@SensorRegistry.register("sensor.camera.optical_flow")
class OpticalFlowCamera(CameraSensor):
    """Motion since this camera's last picture; 0 in its first.

    Vehicles and props move as a whole, without wheels of their own; of walkers, each point of the
    surface moves as it does. An actor that was not there before has not moved. The sky is
    infinitely far away.
    """

    may_be_late = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self._camera: _Seen | None = None
        self._actors: dict[int, _Seen] = {}

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> FlowFrame:
        """The motion of each pixel's surface point."""
        camera = _Seen(
            rotation_matrix(request.rotation_deg), np.array(request.location, np.float64), None
        )
        actors = _seen(state, view.frame)
        motions = _motions(camera, self._camera or camera, actors, self._actors, view.frame)
        self._camera, self._actors = camera, actors
        if not self.lens.distorts:
            made = view.on_card(self.camera(request), Product.FLOW, motions=motions)
            if made is not None:
                flow = made.view(np.float32).reshape(self.height, self.width, 2)
                return FlowFrame(self.fov_deg, flow)
        hits = view.camera(self.camera(request))
        return FlowFrame(self.fov_deg, self._flow(motions, hits, view))

    def _flow(self, motions: Motions, hits: Hits, view: View) -> NDArray[np.float32]:
        """``(H, W, 2)`` motion of all pixels."""
        half_width = math.tan(math.radians(self.fov_deg) / 2.0)
        half = half_width, half_width * self.height / self.width
        rays = pixel_places(self.width, self.height, self.lens)
        count = self.width * self.height
        before = np.empty((2, count if self.lens.distorts else 0))
        flow = np.empty((count, 2), np.float32)
        met = hits.row, hits.triangle, hits.weights, hits.t
        view.in_parts(flow_of_motions, (motions, *met, *rays, *half, before, flow), count)
        if self.lens.distorts:
            self._through_the_lens(before, flow, view.threads)
        return flow.reshape(self.height, self.width, 2)

    def _through_the_lens(
        self, before: FloatArray, flow: NDArray[np.float32], threads: int
    ) -> None:
        """Motions by where a pinhole camera saw points before: both are bent.

        Powers of numbers are NumPy's: a kernel's might differ by machine.
        """
        x, y = pixel_places(self.width, self.height, PINHOLE)

        def work(first: int) -> None:
            part = slice(first, first + _BAND)
            x_before, y_before = self.lens.distorted(*before[:, part])
            band = flow[part]
            np.subtract(x[part], x_before, out=band[:, 0], casting="same_kind")
            np.subtract(y_before, y[part], out=band[:, 1], casting="same_kind")
            np.clip(band, -LARGEST, LARGEST, out=band)

        with ThreadPoolExecutor(threads, thread_name_prefix="lens") as pool:
            list(pool.map(work, range(0, len(flow), _BAND)))


def _motions(
    camera: _Seen,
    camera_before: _Seen,
    actors: dict[int, _Seen],
    known: dict[int, _Seen],
    frame: Frame,
) -> Motions:
    """What changed between two pictures, for the rows of a frame's instances."""
    moves = [_between(camera, camera_before)]
    part = np.zeros(len(frame.actor_id), np.int32)
    bent = np.full(len(frame.actor_id), RIGID, np.int32)
    bends: list[NDArray[np.float32]] = []
    for row, actor_id in enumerate(frame.actor_id.tolist()):
        now, before = actors[actor_id], known.get(actor_id)
        if before is None:
            continue
        if not now.is_as(before):
            part[row] = len(moves)
            moves.append(_between(camera, camera_before, now, before))
        change = now.bent_from(before)
        if change is not None:
            bent[row] = sum(map(len, bends))
            bends.append(_turned(change, camera_before.rotation.T @ before.rotation))
    turn, shift = (np.array(of_parts) for of_parts in zip(*moves, strict=True))
    return Motions(
        turn=turn,
        shift=shift,
        part=part,
        first=np.array([shape.first for shape in frame.shapes], np.int32),
        bent=bent,
        bend=np.concatenate(bends) if bends else np.empty((0, 3, 3), np.float32),
    )


def _turned(vectors: NDArray[np.float32], rotation: FloatArray) -> NDArray[np.float32]:
    """``(T, 3, 3)`` vectors, the last axis turned."""
    axes = rotation.astype(np.float32)
    turned = np.empty_like(vectors)
    # Sums written out: a matrix product may add in another order on another machine.
    for axis in range(3):
        turned[..., axis] = (
            vectors[..., 0] * axes[axis, 0]
            + vectors[..., 1] * axes[axis, 1]
            + vectors[..., 2] * axes[axis, 2]
        )
    return turned


def _between(
    camera: _Seen, camera_before: _Seen, actor: _Seen | None = None, before: _Seen | None = None
) -> tuple[FloatArray, FloatArray]:
    """Rotation and shift that take a point from today's camera axes to those of before.

    Without an actor the point stood still in the world.
    """
    turn, place = camera.rotation, camera.location
    if actor is not None and before is not None:
        moved = before.rotation @ actor.rotation.T
        turn, place = moved @ turn, moved @ (place - actor.location) + before.location
    back = camera_before.rotation.T
    return back @ turn, back @ (place - camera_before.location)


def _seen(state: WorldState, frame: Frame) -> dict[int, _Seen]:
    """The actors of a frame by their ids."""
    rows = np.searchsorted(state.actor_id, frame.actor_id)
    rotations = rotation_matrix(state.rotation_deg[rows].reshape(-1, 3))
    return {
        int(state.actor_id[row]): _Seen(
            rotations[index],
            state.location[row],
            frame.shapes[index].corners if state.kind[row] == ActorKind.WALKER else None,
        )
        for index, row in enumerate(rows.tolist())
    }
