"""Pictures whose rows are exposed one after the other, while camera and actors move.

Row ``r`` of ``H`` shows the world ``(r / (H - 1) - 1/2) * duration`` seconds after the frame: the
picture's middle is at the frame's time. Everything goes straight on at its velocity and turns at
its rate meanwhile. Poses of walkers stay, as do wheels, weather and light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene
from carstage_sim.render.scene import Frame

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RollingShutter:
    """How long the rows of a picture take, and how what carries its camera moves.

    Attributes:
        duration_s: between the exposures of the first row and the last.
        around: place of the carrier at the frame's time, world metres.
        velocity: of the carrier, m/s, world.
        turn_rate: of the carrier about its place, rad/s, world axes.
    """

    duration_s: float
    around: tuple[float, float, float]
    velocity: tuple[float, float, float]
    turn_rate: tuple[float, float, float]

    def times_s(self, height: int) -> FloatArray:
        """``(H,)`` when each row is exposed, from the frame's time on."""
        return (np.arange(height) / max(height - 1, 1) - 0.5) * (self.duration_s * (height > 1))


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """How the instances of a frame move.

    Attributes:
        velocity: ``(I, 3)`` float64 m/s, world.
        turn_rate: ``(I, 3)`` float64 rad/s about each one's place, world axes.
    """

    velocity: FloatArray
    turn_rate: FloatArray


class Rows:
    """What each row of a picture is seen from, and what can be met then.

    Args:
        frame: the scene of the frame's time.
        drift: how its instances move.
        shutter: how the camera moves, and for how long.
        height: rows.
        location: ``(3,)`` of the camera at the frame's time, world metres.
        rotation: ``(3, 3)`` world_from_camera then.

    Attributes:
        origins: ``(H, 3)`` float32 where the camera is, world metres.
        rotations: ``(H, 3, 3)`` float64 world_from_camera.
    """

    def __init__(
        self,
        frame: Frame,
        drift: Drift,
        shutter: RollingShutter,
        height: int,
        location: FloatArray,
        rotation: FloatArray,
    ) -> None:
        self._times_s = shutter.times_s(height)
        turns = turns_of(np.asarray(shutter.turn_rate) * self._times_s[:, None])
        around = np.asarray(shutter.around)
        shift = np.asarray(shutter.velocity) * self._times_s[:, None]
        moved = _turned(turns, (location - around)[:, None])[..., 0] - (location - around)
        self.origins: NDArray[np.float32] = (location + (moved + shift)).astype(np.float32)
        self.rotations: FloatArray = _turned(turns, rotation)
        self._drift = drift
        self._moving = np.flatnonzero((drift.velocity != 0).any(1) | (drift.turn_rate != 0).any(1))
        self._scene = frame.scene
        self._scenes: dict[int, Scene] = {}
        if len(self._moving):
            longest_s = float(self._times_s[-1])
            corner = np.abs(frame.bounds).max(axis=1)
            swing = np.sqrt((drift.turn_rate**2).sum(1) * (corner**2).sum(1))
            spare = (np.sqrt((drift.velocity**2).sum(1)) + swing) * longest_s
            self._scene = frame.with_larger_boxes(spare.astype(np.float32))

    def __len__(self) -> int:
        return len(self.origins)

    def scene(self, row: int) -> Scene:
        """What can be met while a row is exposed; the same again for the same row."""
        if not len(self._moving):
            return self._scene
        if row not in self._scenes:
            self._scenes[row] = self._scene_at(row)
        return self._scenes[row]

    def _scene_at(self, row: int) -> Scene:
        moving, scene = self._moving, self._scene
        time_s = self._times_s[row]
        rotation, position = scene.rotation.copy(), scene.position.copy()
        turns = turns_of(self._drift.turn_rate[moving] * time_s)
        rotation[moving] = _turned(turns, scene.rotation[moving])
        position[moving] += self._drift.velocity[moving] * time_s
        return scene._replace(rotation=rotation, position=position)


def turns_of(vectors: FloatArray) -> FloatArray:
    """``(N, 3, 3)`` rotations of ``(N, 3)`` axes times angles (rad), by Rodrigues' formula."""
    angle = np.sqrt((vectors**2).sum(axis=1))
    axis = vectors / np.maximum(angle, 1e-300)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    x, y, z = axis.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = z, -y, x
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    turns: FloatArray = np.eye(3) + sine * cross + (1.0 - cosine) * _turned(cross, cross)
    return turns


def _turned(turns: FloatArray, matrices: NDArray[np.floating]) -> FloatArray:
    """Products of ``(N, 3, 3)`` and ``(N, 3, K)`` or ``(3, K)``.

    Sums written out: a matrix product may add in another order on another machine.
    """
    wide = np.asarray(matrices, np.float64)
    product: FloatArray = sum(
        turns[:, :, axis, None] * wide[..., axis, None, :] for axis in range(3)
    )  # type: ignore[assignment]
    return product
