"""Boxes and projections of KITTI's label files, as its devkit computes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Matrices = dict[str, NDArray[np.float64]]


def calibration(path: Path) -> Matrices:
    matrices = {}
    for line in path.read_text().splitlines():
        name, *values = line.split()
        matrices[name.rstrip(":")] = np.array(values, np.float64).reshape(3, -1)
    return matrices


def corners(row: list[float]) -> NDArray[np.float64]:
    """The 8 corners of a label row (h w l x y z rotation_y) in the camera, as the devkit has it."""
    h, w, length, x, y, z, angle = row
    xs = np.array([1, 1, -1, -1, 1, 1, -1, -1]) * length / 2
    ys = np.array([0, 0, 0, 0, -1, -1, -1, -1]) * h
    zs = np.array([1, -1, -1, 1, 1, -1, -1, 1]) * w / 2
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return (rotation @ np.stack([xs, ys, zs])).T + np.array([x, y, z])


def pixels(points: NDArray[np.float64], projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """``(N, 2)`` pixels from the picture's corner; KITTI's count from the first one's centre."""
    uvw = np.column_stack([points, np.ones(len(points))]) @ projection.T
    return uvw[:, :2] / uvw[:, 2:] + 0.5
