"""Where the voxels of a frame are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FLU_FROM_CARLA, FloatArray, invert_pose, multiply
from carstage.spec import OccupancySpec

FREE: Final = 255
"""Semantics of a voxel in which nothing is known to be."""

Triple = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class VoxelGrid:
    """Voxels along forward, left and up of a frame; the first is farthest behind, right and down.

    Attributes:
        low_m: least forward, left and up.
        shape: voxels along each.
        side_m: of a voxel.
    """

    low_m: tuple[float, float, float]
    shape: Triple
    side_m: float

    @classmethod
    def of(cls, spec: OccupancySpec) -> VoxelGrid:
        """The voxels that a specification asks for."""
        x, y, z = (round(count) for count in spec.cells)
        return cls((-spec.behind_m, -spec.right_m, -spec.down_m), (x, y, z), spec.resolution_m)

    @property
    def count(self) -> int:
        """How many voxels there are."""
        x, y, z = self.shape
        return x * y * z

    @property
    def lengths_m(self) -> FloatArray:
        """``(3,)`` along forward, left and up."""
        return np.array(self.shape) * self.side_m

    def units_from(self, grid_from_other: FloatArray) -> FloatArray:
        """``(3, 4)`` from another frame to voxels, counted from the grid's lower corner."""
        matrix = grid_from_other[:3].copy()
        matrix[:, 3] -= self.low_m
        return np.asarray(matrix / self.side_m, dtype=np.float64)

    def cells(self, units: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Flat numbers of the voxels that places ``(N, 3)`` are in, and which are in any.

        Args:
            units: as :meth:`units_from` gives them.

        Returns:
            ``(M,)`` numbers of those within, ``(N,)`` which these are.
        """
        inside = self.holds(units)
        x, y, z = (column[inside].astype(np.int64) for column in units.T)
        return self.flat(x, y, z), inside

    def holds(self, units: FloatArray) -> NDArray[np.bool_]:
        """``(N,)`` which places ``(N, 3)`` are in a voxel."""
        inside: NDArray[np.bool_] = np.ones(len(units), np.bool_)
        for column, most in zip(units.T, self.shape, strict=True):
            inside &= (column >= 0.0) & (column < most)
        return inside

    def flat(
        self, x: NDArray[np.int64], y: NDArray[np.int64], z: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Flat numbers of voxels."""
        return np.asarray((x * self.shape[1] + y) * self.shape[2] + z)

    def centres(self, flat: NDArray[np.int64]) -> FloatArray:
        """``(N, 3)`` metres forward, left and up of voxels by their flat numbers."""
        x, rest = np.divmod(flat, self.shape[1] * self.shape[2])
        y, z = np.divmod(rest, self.shape[2])
        return np.stack([x, y, z], axis=-1) * self.side_m + (np.array(self.low_m) + self.side_m / 2)


def grid_from_world(world_from_frame: FloatArray) -> FloatArray:
    """``(4, 4)`` from CARLA's world to forward, left and up of an actor or sensor."""
    matrix = np.eye(4)
    matrix[:3] = multiply(FLU_FROM_CARLA, invert_pose(world_from_frame)[:3])
    return matrix


def placed(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """``(N, 3)`` points ``(N, 3)`` through a ``(3 or 4, 4)`` matrix, see ``multiply``."""
    columns: FloatArray = np.empty((3, len(points)), np.float64)
    term = np.empty(len(points), np.float64)
    x, y, z = points.T
    for row, column in zip(matrix[:3], columns, strict=True):
        np.multiply(x, row[0], out=column)
        column += np.multiply(y, row[1], out=term)
        column += np.multiply(z, row[2], out=term)
        column += row[3]
    return columns.T  # column by column in memory, as it is read
