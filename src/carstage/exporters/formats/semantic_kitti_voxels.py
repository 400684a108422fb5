"""SemanticKITTI's scene completion: a sweep's voxels, and what a whole sequence knows of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import Occupancy
from carstage.exporters.axes import flu_points


def voxel_files(
    content: Occupancy, points: NDArray[np.float32], labels: NDArray[np.uint32]
) -> dict[str, bytes]:
    """Contents by ending; bits are packed from the highest on, as the devkit unpacks them.

    - ``.bin``: a point of this sweep lies in the voxel.
    - ``.label``: uint16, the class; 0 where nothing is known to be.
    - ``.invalid``: nothing is known to be there, and no sensor of this frame looks through it.
    - ``.occluded``: no ray of a LiDAR of this frame passes it or ends in it.

    Args:
        content: voxels around the LiDAR.
        points: ``(N, 4)`` of the sweep, CARLA's sensor axes.
        labels: ``(M,)`` SemanticKITTI's labels of the occupied voxels, in their order.
    """
    grid = content.grid
    units = (flu_points(points)[:, :3] - np.array(grid.low_m)) / grid.side_m
    hit = np.zeros(grid.count, np.bool_)
    hit[grid.cells(units)[0]] = True
    classes = np.zeros(grid.count, "<u2")
    classes[content.occupied.ravel()] = labels & 0xFFFF
    return {
        ".bin": np.packbits(hit).tobytes(),
        ".label": classes.tobytes(),
        ".invalid": np.packbits(~content.occupied & (content.seen == 0)).tobytes(),
        ".occluded": np.packbits(~content.visible_by_lidar).tobytes(),
    }
