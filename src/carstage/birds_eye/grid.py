"""Where the cells of a grid are, and which of them a triangle covers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray
from carstage.spec import BirdsEyeSpec

UNITS_PER_M: Final = 10_000
"""Corners are rounded to 0.1 mm. From there on all is exact, in whole numbers."""

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class GridPose:
    """Where a grid is: the ego's pivot and heading; the grid lies level.

    Attributes:
        x_m, y_m, z_m: of the ego's pivot in the world.
        yaw_deg: the ego's yaw.
    """

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float

    def forward_right(self, places: FloatArray) -> FloatArray:
        """``(..., 2)`` metres forward and right of the ego, of places ``(..., 2 or 3)``."""
        return self.turned(
            np.stack([places[..., 0] - self.x_m, places[..., 1] - self.y_m], axis=-1)
        )

    def turned(self, vectors: FloatArray) -> FloatArray:
        """``(..., 2)`` parts forward and right of vectors ``(..., 2 or 3)`` of the world."""
        yaw = math.radians(self.yaw_deg)
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack([x * cos + y * sin, y * cos - x * sin], axis=-1)

    def world(self, forward_right: FloatArray) -> FloatArray:
        """``(..., 2)`` places in the world, the inverse of :meth:`forward_right`."""
        yaw = math.radians(self.yaw_deg)
        cos, sin = math.cos(yaw), math.sin(yaw)
        forward, right = forward_right[..., 0], forward_right[..., 1]
        x = self.x_m + (forward * cos - right * sin)
        y = self.y_m + (forward * sin + right * cos)
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True, slots=True)
class Grid:
    """The cells: row 0 is farthest ahead, column 0 farthest left, the ego's pivot in the middle.

    Attributes:
        length_m: along the ego's heading.
        width_m: across it.
        resolution_m: side of a cell; both sides are whole numbers of cells.
    """

    length_m: float
    width_m: float
    resolution_m: float

    @classmethod
    def of(cls, spec: BirdsEyeSpec) -> Grid:
        """The grid that a specification asks for."""
        return cls(spec.length_m, spec.width_m, spec.resolution_m)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return round(self.length_m / self.resolution_m), round(self.width_m / self.resolution_m)

    @property
    def radius_m(self) -> float:
        """From the middle to a corner."""
        return math.hypot(self.length_m, self.width_m) / 2.0

    def cell_centres(self) -> FloatArray:
        """``(H, W, 2)`` metres forward and right of the ego's pivot."""
        rows, columns = self.shape
        forward = self.length_m / 2.0 - (np.arange(rows) + 0.5) * self.resolution_m
        right = (np.arange(columns) + 0.5) * self.resolution_m - self.width_m / 2.0
        return np.stack(np.meshgrid(forward, right, indexing="ij"), axis=-1)

    def cells(self, forward_right: FloatArray) -> tuple[Integers, NDArray[np.bool_]]:
        """``(N,)`` flat numbers of the cells that places are in, and whether they are in any."""
        rows, columns = self.shape
        units = self.units(forward_right)
        column, row = np.moveaxis(units // round(self.resolution_m * UNITS_PER_M), -1, 0)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return row * columns + column, inside

    def units(self, forward_right: FloatArray) -> Integers:
        """``(..., 2)`` to the right and down from the grid's upper left corner, in 0.1 mm."""
        down = self.length_m / 2.0 - forward_right[..., 0]
        right = self.width_m / 2.0 + forward_right[..., 1]
        return np.rint(np.stack([right, down], axis=-1) * UNITS_PER_M).astype(np.int64)

    def covered(self, triangles: Integers) -> tuple[Integers, Integers]:
        """The cells whose centres lie in triangles.

        A centre on an edge belongs to what lies to its right, or below it. So triangles that share
        an edge share no cell, and leave none out.

        Args:
            triangles: ``(N, 3, 2)`` corners as :meth:`units` gives them, of any orientation.

        Returns:
            ``(M,)`` numbers of triangles, ascending, and ``(M,)`` flat numbers of cells.
        """
        rows, columns = self.shape
        side = round(self.resolution_m * UNITS_PER_M)
        half = side // 2
        order = np.argsort(triangles[:, :, 1], axis=1, kind="stable")
        corners = np.take_along_axis(triangles, order[:, :, None], axis=1) - half
        top, middle, bottom = corners[:, 0], corners[:, 1], corners[:, 2]
        first = np.maximum(-(-top[:, 1] // side), 0)
        counts = np.maximum(np.minimum(-(-bottom[:, 1] // side), rows) - first, 0)
        owner, step = _runs(counts)
        row = first[owner] + step
        y = row * side
        top, middle, bottom = top[owner], middle[owner], bottom[owner]
        upper = (y < middle[:, 1])[:, None]
        one = _first_column(top, bottom, y, side)
        other = _first_column(
            np.where(upper, top, middle), np.where(upper, middle, bottom), y, side
        )
        left = np.clip(np.minimum(one, other), 0, columns)
        right = np.clip(np.maximum(one, other), 0, columns)
        span, step = _runs(right - left)
        return owner[span], row[span] * columns + left[span] + step


def _first_column(a: Integers, b: Integers, y: Integers, side: int) -> Integers:
    """The first column whose centre is not left of an edge from ``a`` down to ``b``, at ``y``."""
    height = b[:, 1] - a[:, 1]
    along = a[:, 0] * height + (y - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray(-(-along // (side * height)))


def _runs(counts: Integers) -> tuple[Integers, Integers]:
    """Each index as often as its count says, and the number of the repetition, from 0."""
    owner = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return owner, np.arange(len(owner)) - np.repeat(ends - counts, counts)
