"""The file of one frame's voxels; see docs/formats/occupancy.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.geometry import FloatArray
from carstage.occupancy.grid import FREE, VoxelGrid
from carstage.occupancy.placing import Voxels
from carstage.spec.occupancy import MOST_VOXELS

_GRIDS: Final = {"semantic": "uint8", "instance": "uint16"}
_ROWS: Final = ("pivot_m", "velocity_m_s", "angular_velocity_rad_s")
FOLDER: Final = "occupancy"
"""Of the files, below the episode."""


@dataclass(frozen=True, slots=True, eq=False)
class Occupancy:
    """The voxels of one frame: ``[i, j, k]`` counts from behind, from the right, from below.

    Attributes:
        grid: size and resolution.
        world_from_frame: ``(4, 4)`` pose of the ego or sensor that they are around, CARLA's axes.
        voxels: what is stored of what is in them.
        seen: ``(X, Y, Z)`` uint8, bits of the sensors that see each.
    """

    grid: VoxelGrid
    world_from_frame: FloatArray
    voxels: Voxels
    seen: NDArray[np.uint8]

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """``(X, Y, Z)`` the semantic tag of what is there; ``FREE``: nothing is known to be."""
        return self.voxels.semantic

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """``(X, Y, Z)`` whether a surface is there."""
        return np.asarray(self.voxels.semantic != FREE)

    @property
    def tracks(self) -> NDArray[np.int64]:
        """``(X, Y, Z)`` the ``track_id`` of the road user that is there; 0: none."""
        return np.append(np.int64(0), self.voxels.track_id)[self.voxels.instance]

    @property
    def flow_m_s(self) -> NDArray[np.float32]:
        """``(X, Y, Z, 3)`` how road users move over the ground: forward, left, up; else 0.

        Every voxel's centre moves with its box: the pivot's velocity, and what turning adds.
        """
        flow: NDArray[np.float32] = np.zeros((*self.grid.shape, 3), np.float32)
        flat = np.flatnonzero(self.voxels.instance)
        owner = self.voxels.instance.ravel()[flat].astype(np.int64) - 1
        arm = self.grid.centres(flat) - self.voxels.pivot_m[owner]
        turning = self.voxels.angular_velocity_rad_s[owner].astype(np.float64)
        moved = self.voxels.velocity_m_s[owner] + np.cross(turning, arm)
        flow.reshape(-1, 3)[flat] = moved
        return flow

    @property
    def visible_by_camera(self) -> NDArray[np.bool_]:
        """``(X, Y, Z)`` whether a ray of a labelled camera passes a voxel or ends in it."""
        return np.asarray(self.seen & CAMERA, dtype=np.bool_)

    @property
    def visible_by_lidar(self) -> NDArray[np.bool_]:
        """``(X, Y, Z)`` whether a ray of a LiDAR passes a voxel or ends in it."""
        return np.asarray(self.seen & LIDAR, dtype=np.bool_)

    def centres(self) -> FloatArray:
        """``(X, Y, Z, 3)`` metres forward, left and up of the frame's origin."""
        return self.grid.centres(np.arange(self.grid.count)).reshape(*self.grid.shape, 3)


def occupancy_name(k: int) -> str:
    """The path of frame ``k``'s file below its episode."""
    return f"{FOLDER}/{k:06d}.npz"


def pack_occupancy(content: Occupancy) -> bytes:
    """The bytes of the file; the same voxels give the same bytes."""
    voxels, grid = content.voxels, content.grid
    return pack_npz(
        {
            **{name: getattr(voxels, name) for name in _GRIDS},
            "seen": content.seen,
            "track_id": voxels.track_id,
            **{name: getattr(voxels, name) for name in _ROWS},
            "low_m": np.array(grid.low_m, np.float64),
            "side_m": np.array([grid.side_m], np.float64),
            "world_from_frame": content.world_from_frame,
        }
    )


def unpack_occupancy(content: bytes) -> Occupancy:
    """The voxels of a file.

    Raises:
        ValueError: it is damaged, or of another version.
    """
    semantic = _array(content, "semantic", "uint8", (None, None, None))
    shape = semantic.shape
    if not 0 < semantic.size <= MOST_VOXELS:
        raise ValueError("it has no voxels, or too many")
    low_m = _array(content, "low_m", "float64", (3,))
    side_m = _array(content, "side_m", "float64", (1,))
    pose = _array(content, "world_from_frame", "float64", (4, 4))
    if not (np.isfinite(low_m).all() and np.isfinite(pose).all() and 0.0 < side_m[0] < np.inf):
        raise ValueError("its place or size is no number")
    tracks = _array(content, "track_id", "int64", (None,))
    instance = _array(content, "instance", "uint16", shape)
    if instance.max(initial=0) > len(tracks):
        raise ValueError("it names an object that it does not list")
    rows = {name: _array(content, name, "float32", (len(tracks), 3)) for name in _ROWS}
    forward, left, up = low_m.tolist()
    length, width, height = shape
    grid = VoxelGrid((forward, left, up), (length, width, height), float(side_m[0]))
    seen = _array(content, "seen", "uint8", shape)
    return Occupancy(grid, pose, Voxels(semantic, instance, tracks, **rows), seen)


def _array(content: bytes, name: str, kind: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    array = unpack_npz(content, name)
    if array.dtype != np.dtype(kind):
        raise ValueError(f"{name} is of type {array.dtype}, not {kind}")
    fits = len(shape) == array.ndim and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} has shape {array.shape}")
    return array
