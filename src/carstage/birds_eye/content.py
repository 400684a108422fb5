"""The file of one frame's grids; see docs/formats/birds-eye.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.drawing import NO_HEIGHT_CM, Drawn
from carstage.birds_eye.grid import Grid, GridPose
from carstage.birds_eye.layers import LAYERS
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.geometry import FloatArray

_GRIDS: Final = {
    "semantic": "uint32",
    "instance": "uint16",
    "height_cm": "int16",
    "visible": "uint8",
}
_LARGEST_CELLS: Final = 1 << 26
FOLDER: Final = "birds_eye"
"""Of the files, below the episode."""


@dataclass(frozen=True, slots=True, eq=False)
class BirdsEye:
    """The grids of one frame.

    Row 0 is farthest ahead of the ego, column 0 farthest left.

    Attributes:
        grid: size and resolution.
        pose: where the grid is.
        drawn: what is stored.
    """

    grid: Grid
    pose: GridPose
    drawn: Drawn

    @property
    def semantic(self) -> NDArray[np.uint32]:
        """``(H, W)`` all layers, one bit each in the order of ``LAYERS``."""
        return self.drawn.semantic

    def layer(self, name: str) -> NDArray[np.bool_]:
        """``(H, W)`` where a layer is.

        Raises:
            KeyError: there is no layer of that name; see ``LAYERS``.
        """
        if name not in LAYERS:
            raise KeyError(f"no layer {name!r}; there are {', '.join(LAYERS)}")
        return np.asarray(self.drawn.semantic >> LAYERS.index(name) & 1, dtype=np.bool_)

    @property
    def tracks(self) -> NDArray[np.int64]:
        """``(H, W)`` the ``track_id`` of the object in each cell; 0: none."""
        return np.append(np.int64(0), self.drawn.track_id)[self.drawn.instance]

    @property
    def velocity_m_s(self) -> NDArray[np.float32]:
        """``(H, W, 2)`` of the object in each cell, forward and right; 0 where there is none."""
        none = np.zeros((1, 2), np.float32)
        return np.concatenate([none, self.drawn.velocity_m_s])[self.drawn.instance]

    @property
    def height_m(self) -> NDArray[np.float32]:
        """``(H, W)`` of the ground above the ego's pivot; NaN where no lane is."""
        height = self.drawn.height_cm.astype(np.float32) / np.float32(100.0)
        height[self.drawn.height_cm == NO_HEIGHT_CM] = np.nan
        return height

    @property
    def visible_by_camera(self) -> NDArray[np.bool_]:
        """``(H, W)`` whether a labelled camera sees the cell."""
        return np.asarray(self.drawn.visible & CAMERA, dtype=np.bool_)

    @property
    def visible_by_lidar(self) -> NDArray[np.bool_]:
        """``(H, W)`` whether a point of a LiDAR lies in the cell."""
        return np.asarray(self.drawn.visible & LIDAR, dtype=np.bool_)

    def cell_centres(self) -> FloatArray:
        """``(H, W, 2)`` metres forward and right of the ego's pivot."""
        return self.grid.cell_centres()

    def world(self) -> FloatArray:
        """``(H, W, 2)`` x and y of the cells' centres in the world."""
        return self.pose.world(self.cell_centres())


def birds_eye_name(k: int) -> str:
    """The path of frame ``k``'s file below its episode."""
    return f"{FOLDER}/{k:06d}.npz"


def pack_birds_eye(content: BirdsEye) -> bytes:
    """The bytes of the file; the same grids give the same bytes."""
    drawn, grid, pose = content.drawn, content.grid, content.pose
    return pack_npz(
        {
            **{name: getattr(drawn, name) for name in _GRIDS},
            "track_id": drawn.track_id,
            "velocity_m_s": drawn.velocity_m_s,
            "layers": np.array(LAYERS),
            "size_m": np.array([grid.length_m, grid.width_m, grid.resolution_m]),
            "pose": np.array([pose.x_m, pose.y_m, pose.z_m, pose.yaw_deg]),
        }
    )


def unpack_birds_eye(content: bytes) -> BirdsEye:
    """The grids of a file.

    Raises:
        ValueError: it is damaged, or of another version.
    """
    if tuple(_array(content, "layers", None, (len(LAYERS),)).tolist()) != LAYERS:
        raise ValueError("its layers are not those of this version")
    grid = Grid(*_array(content, "size_m", "float64", (3,)).tolist())
    pose = GridPose(*_array(content, "pose", "float64", (4,)).tolist())
    if not np.isfinite([grid.length_m, grid.width_m, grid.resolution_m, pose.yaw_deg]).all():
        raise ValueError("its size or pose is no number")
    if min(grid.length_m, grid.width_m, grid.resolution_m) <= 0.0:
        raise ValueError("its size is not above zero")
    sides = grid.length_m / grid.resolution_m, grid.width_m / grid.resolution_m
    if sides[0] * sides[1] > _LARGEST_CELLS:
        raise ValueError("it is too large")
    grids = {name: _array(content, name, kind, grid.shape) for name, kind in _GRIDS.items()}
    tracks = _array(content, "track_id", "int64", None)
    velocity = _array(content, "velocity_m_s", "float32", (len(tracks), 2))
    if grids["instance"].max(initial=0) > len(tracks):
        raise ValueError("it names an object that it does not list")
    return BirdsEye(grid, pose, Drawn(**grids, track_id=tracks, velocity_m_s=velocity))


def _array(
    content: bytes, name: str, kind: str | None, shape: tuple[int, ...] | None
) -> NDArray[Any]:
    array = unpack_npz(content, name)
    if kind is not None and array.dtype != np.dtype(kind):
        raise ValueError(f"{name} is of type {array.dtype}, not {kind}")
    if array.shape != shape if shape is not None else array.ndim != 1:
        raise ValueError(f"{name} has shape {array.shape}")
    return array
