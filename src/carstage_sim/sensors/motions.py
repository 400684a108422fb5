"""How what a camera sees moved between two instants, and across its picture."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.motion import LARGEST, RIGID, Motions, flow_of_motions
from carstage_sim.render.scene import Frame
from carstage_sim.sensors.lens import PINHOLE, pixel_places
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.state import ActorKind, WorldState

_BAND = 1 << 16
"""Pixels that a thread bends at a time."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Where an actor was, or a part of one that moves by itself.

    Attributes:
        rotation: ``(3, 3)`` world_from_actor.
        location: ``(3,)`` world metres.
        figure: ``(T, 3, 3)`` corners of a walker's triangles in its frame; None of what is rigid.
    """

    rotation: FloatArray
    location: FloatArray
    figure: NDArray[np.float32] | None

    def is_as(self, before: Seen) -> bool:
        """Whether nothing of it has moved."""
        return np.array_equal(self.rotation, before.rotation) and np.array_equal(
            self.location, before.location
        )

    def carried(self, now: Seen, before: Seen) -> Seen:
        """Where it was if it moved as ``now`` did, which was ``before``."""
        moved = before.rotation @ now.rotation.T
        place = moved @ (self.location - now.location) + before.location
        return Seen(moved @ self.rotation, place, None)

    def bent_from(self, before: Seen) -> NDArray[np.float32] | None:
        """``(T, 3, 3)`` what to add to a figure's corners for its pose of before; None: nothing."""
        now, then = self.figure, before.figure
        if now is None or then is None or now is then or len(now) != len(then):
            return None
        change: NDArray[np.float32] = then - now
        return change


SeenActors = dict[tuple[int, int], Seen]
"""What was seen, by the actor's id and the number of its part: 0 is its body."""


def flow_of(camera: Camera, motions: Motions, view: View) -> NDArray[np.float32]:
    """``(H, W, 2)`` motion of all pixels of a camera, made on the CPU.

    Args:
        camera: who looks.
        motions: of everything.
        view: of the tick.
    """
    hits, lens = view.camera(camera), camera.lens
    half_width = math.tan(math.radians(camera.fov_deg) / 2.0)
    half = half_width, half_width * camera.height / camera.width
    rays = pixel_places(camera.width, camera.height, lens)
    count = camera.width * camera.height
    before = np.empty((2, count if lens.distorts else 0))
    flow = np.empty((count, 2), np.float32)
    met = hits.row, hits.triangle, hits.weights, hits.t
    view.in_parts(flow_of_motions, (motions, *met, *rays, *half, before, flow), count)
    if lens.distorts:
        _through_the_lens(camera, before, flow, view.threads)
    return flow.reshape(camera.height, camera.width, 2)


def _through_the_lens(
    camera: Camera, before: FloatArray, flow: NDArray[np.float32], threads: int
) -> None:
    """Motions by where a pinhole camera saw points before: both are bent.

    Powers of numbers are NumPy's: a kernel's might differ by machine.
    """
    x, y = pixel_places(camera.width, camera.height, PINHOLE)

    def work(first: int) -> None:
        part = slice(first, first + _BAND)
        x_before, y_before = camera.lens.distorted(*before[:, part])
        band = flow[part]
        np.subtract(x[part], x_before, out=band[:, 0], casting="same_kind")
        np.subtract(y_before, y[part], out=band[:, 1], casting="same_kind")
        np.clip(band, -LARGEST, LARGEST, out=band)

    with ThreadPoolExecutor(threads, thread_name_prefix="lens") as pool:
        list(pool.map(work, range(0, len(flow), _BAND)))


def motions_between(
    camera: Seen,
    camera_before: Seen,
    actors: SeenActors,
    known: SeenActors,
    frame: Frame,
) -> Motions:
    """What changed between two pictures, for the rows of a frame's instances."""
    moves = [_between(camera, camera_before)]
    part = np.zeros(len(frame.actor_id), np.int32)
    bent = np.full(len(frame.actor_id), RIGID, np.int32)
    bends: list[NDArray[np.float32]] = []
    for row, key in enumerate(_keys(frame)):
        now, body, body_before = actors[key], actors[key[0], 0], known.get((key[0], 0))
        if body_before is None:
            continue
        before = known.get(key) or now.carried(body, body_before)
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
    camera: Seen, camera_before: Seen, actor: Seen | None = None, before: Seen | None = None
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


def _keys(frame: Frame) -> list[tuple[int, int]]:
    """Of the rows of a frame, as in :data:`SeenActors`."""
    part = np.arange(len(frame.actor_id)) - frame.body
    return list(zip(frame.actor_id.tolist(), part.tolist(), strict=True))


def seen_actors(state: WorldState, frame: Frame) -> SeenActors:
    """The actors of a frame and their parts."""
    rows = np.searchsorted(state.actor_id, frame.actor_id)
    walks = (state.kind[rows] == ActorKind.WALKER).tolist()
    return {
        key: Seen(
            frame.rotation[index],
            frame.location[index],
            frame.shapes[index].corners if walks[index] else None,
        )
        for index, key in enumerate(_keys(frame))
    }


def motions_in(seconds: float, state: WorldState, request: SensorRequest, frame: Frame) -> Motions:
    """Motions of camera and actors in a time that is short, by their velocities of a tick.

    Everything moves as a whole: legs of walkers do not swing in that time, wheels do not turn.

    Args:
        seconds: the time.
        state: the tick.
        request: the camera, which moves as the actor does that carries it.
        frame: what is seen.
    """
    now, rows = seen_actors(state, frame), np.searchsorted(state.actor_id, frame.actor_id)
    before = {
        key: _earlier(seconds, state, row, *_pose(now[key]))
        for key, row in zip(_keys(frame), rows.tolist(), strict=True)
    }
    camera = Seen(
        rotation_matrix(request.rotation_deg), np.array(request.location, np.float64), None
    )
    carrier = int(np.searchsorted(state.actor_id, request.owner_id))
    carried = carrier < len(state.actor_id) and state.actor_id[carrier] == request.owner_id
    back = _earlier(seconds, state, carrier, *_pose(camera)) if carried else camera
    return motions_between(camera, back, now, before, frame)


def _pose(seen: Seen) -> tuple[FloatArray, FloatArray]:
    return seen.rotation, seen.location


def _earlier(
    seconds: float, state: WorldState, row: int, rotation: FloatArray, location: FloatArray
) -> Seen:
    """Where a body was that moves as a row of the state does."""
    turn = _turn(np.radians(state.angular_velocity_deg[row]) * -seconds)
    centre = state.location[row]
    place = turn @ (location - centre) + centre - state.velocity[row] * seconds
    return Seen(turn @ rotation, place, None)


def _turn(vector: FloatArray) -> FloatArray:
    """``(3, 3)`` rotation about a vector by its length in radians (Rodrigues)."""
    angle = math.sqrt(float(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2))
    x, y, z = (vector / max(angle, 1e-12)).tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = (
        np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    )
    return turned
