"""Rays through voxels, and voxels through lenses, compiled: numpy takes several times as long.

The walk of rays is after Amanatides and Woo, A Fast Voxel Traversal Algorithm for Ray Tracing
(1987).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.kernels import compiled


@compiled
def mark_passed(
    origin: NDArray[np.float64],
    ends: NDArray[np.float64],
    seen: NDArray[np.bool_],
) -> None:
    """Mark the voxels that rays from one place pass or end in.

    Args:
        origin: ``(3,)`` of the rays, in voxels from the grid's lower corner; it may be outside.
        ends: ``(N, 3)`` likewise; rays that end outside are followed to where they leave the grid.
        seen: ``(X, Y, Z)``, set. No ray is followed to a voxel that an earlier one has seen.
    """
    cell = np.zeros(3, np.int64)
    last = np.zeros(3, np.int64)
    step = np.zeros(3, np.int64)
    way = np.zeros(3)
    crosses = np.zeros(3)
    apart = np.zeros(3)
    for n in range(ends.shape[0]):
        enters, leaves = 0.0, 1.0
        for axis in range(3):
            way[axis] = ends[n, axis] - origin[axis]
            if way[axis] == 0.0:
                if origin[axis] < 0.0 or origin[axis] >= seen.shape[axis]:
                    leaves = -1.0
            else:
                one = -origin[axis] / way[axis]
                other = (seen.shape[axis] - origin[axis]) / way[axis]
                enters = max(enters, min(one, other))
                leaves = min(leaves, max(one, other))
        if enters >= leaves:
            continue
        for axis in range(3):
            most = seen.shape[axis] - 1
            cell[axis] = min(max(int(origin[axis] + way[axis] * enters), 0), most)
            last[axis] = min(max(int(origin[axis] + way[axis] * leaves), 0), most)
            step[axis] = 1 if way[axis] > 0.0 else -1
            crosses[axis] = np.inf
            if way[axis] != 0.0:
                plane = cell[axis] + (1 if way[axis] > 0.0 else 0)
                crosses[axis] = (plane - origin[axis]) / way[axis]
                apart[axis] = step[axis] / way[axis]
        if seen[last[0], last[1], last[2]]:
            continue
        seen[last[0], last[1], last[2]] = True
        x, y, z = cell[0], cell[1], cell[2]
        at_x, at_y, at_z = crosses[0], crosses[1], crosses[2]
        while True:
            seen[x, y, z] = True
            if at_x <= at_y and at_x <= at_z:
                if at_x >= leaves:
                    break
                x += step[0]
                at_x += apart[0]
                if x < 0 or x >= seen.shape[0]:
                    break
            elif at_y <= at_z:
                if at_y >= leaves:
                    break
                y += step[1]
                at_y += apart[1]
                if y < 0 or y >= seen.shape[1]:
                    break
            else:
                if at_z >= leaves:
                    break
                z += step[2]
                at_z += apart[2]
                if z < 0 or z >= seen.shape[2]:
                    break


@compiled
def ends_within(
    units: NDArray[np.float64],
    points: NDArray[np.float64],
    shape: tuple[int, int, int],
    numbers: NDArray[np.int32],
    ends: NDArray[np.float64],
) -> int:
    """Bring points into the grid, and part those within from those beyond.

    Args:
        units: ``(3, 4)`` voxels from the grid's lower corner, from the points' frame.
        points: ``(N, 3)``.
        shape: of the grid, in voxels.
        numbers: ``(N,)``, set: which point, for each within the grid, in their order.
        ends: ``(3, N)``, set: of those within, and, the last one first, of those beyond.

    Returns:
        How many are within.
    """
    within, beyond = 0, len(points)
    for n in range(len(points)):
        a, b, c = points[n, 0], points[n, 1], points[n, 2]
        x = units[0, 0] * a + units[0, 1] * b + units[0, 2] * c + units[0, 3]
        y = units[1, 0] * a + units[1, 1] * b + units[1, 2] * c + units[1, 3]
        z = units[2, 0] * a + units[2, 1] * b + units[2, 2] * c + units[2, 3]
        if x >= 0 and x < shape[0] and y >= 0 and y < shape[1] and z >= 0 and z < shape[2]:
            numbers[within], place = n, within
            within += 1
        else:
            beyond -= 1
            place = beyond
        ends[0, place], ends[1, place], ends[2, place] = x, y, z
    return within


@compiled
def shown_places(
    optical: NDArray[np.float32],
    origin: NDArray[np.float32],
    u: NDArray[np.float32],
    v: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    nearest_m: np.float32,
    shape: tuple[int, int, int],
    pixels: NDArray[np.int32],
    places: NDArray[np.float32],
) -> int:
    """Find the pixels that show a place in the grid, row by row, and where it is.

    Args:
        optical, origin, u, v, depth_m, nearest_m: as for :func:`mark_shown`.
        shape: of the grid, in voxels.
        pixels: ``(H * W,)``, set: number of the pixel, for each that is found.
        places: ``(3, H * W)``, set: in voxels from the grid's lower corner.

    Returns:
        How many there are.
    """
    found = 0
    width = depth_m.shape[1]
    for row in range(depth_m.shape[0]):
        x_v = optical[0, 1] * v[row] + optical[0, 2]
        y_v = optical[1, 1] * v[row] + optical[1, 2]
        z_v = optical[2, 1] * v[row] + optical[2, 2]
        for column in range(width):
            depth = depth_m[row, column]
            x = (optical[0, 0] * u[column] + x_v) * depth + origin[0]
            y = (optical[1, 0] * u[column] + y_v) * depth + origin[1]
            z = (optical[2, 0] * u[column] + z_v) * depth + origin[2]
            inside = x >= 0 and x < shape[0] and y >= 0 and y < shape[1] and z >= 0 and z < shape[2]
            if inside and depth > nearest_m:
                pixels[found] = row * width + column
                places[0, found], places[1, found], places[2, found] = x, y, z
                found += 1
    return found


@compiled
def mark_last(
    x: NDArray[np.floating],
    y: NDArray[np.floating],
    z: NDArray[np.floating],
    fine: int,
    shape: tuple[int, int, int],
    last: NDArray[np.int32],
    kept: NDArray[np.bool_],
) -> None:
    """Mark the last of the places in each cell.

    Args:
        x, y, z: ``(N,)`` of each place, all within the grid, in voxels from its lower corner.
        fine: cells to a voxel's side.
        shape: of the grid, in voxels.
        last: room for a number of each cell; what is in it does not matter.
        kept: ``(N,)``, all false; set.
    """
    rows, layers = shape[1] * fine, shape[2] * fine
    for n in range(len(x)):
        cell = (int(x[n] * fine) * rows + int(y[n] * fine)) * layers + int(z[n] * fine)
        last[cell] = n
    for n in range(len(x)):
        cell = (int(x[n] * fine) * rows + int(y[n] * fine)) * layers + int(z[n] * fine)
        kept[n] = last[cell] == n


@compiled
def mark_shown(
    optical: NDArray[np.float32],
    origin: NDArray[np.float32],
    u: NDArray[np.float32],
    v: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    nearest_m: np.float32,
    seen: NDArray[np.bool_],
) -> None:
    """Mark the voxels of the surfaces that a camera's pixels show.

    Args:
        optical: ``(3, 3)`` voxels from the camera's axes: right, down, ahead (m).
        origin: ``(3,)`` of the camera, in voxels from the grid's lower corner.
        u, v: ``(W,)`` and ``(H,)`` slopes of pixels to the right and down.
        depth_m: ``(H, W)`` along the axis.
        nearest_m: what is nearer shows nothing.
        seen: ``(X, Y, Z)``, set.
    """
    most_x, most_y, most_z = seen.shape
    for row in range(depth_m.shape[0]):
        x_v = optical[0, 1] * v[row] + optical[0, 2]
        y_v = optical[1, 1] * v[row] + optical[1, 2]
        z_v = optical[2, 1] * v[row] + optical[2, 2]
        for column in range(depth_m.shape[1]):
            depth = depth_m[row, column]
            x = (optical[0, 0] * u[column] + x_v) * depth + origin[0]
            y = (optical[1, 0] * u[column] + y_v) * depth + origin[1]
            z = (optical[2, 0] * u[column] + z_v) * depth + origin[2]
            inside = x >= 0 and x < most_x and y >= 0 and y < most_y and z >= 0 and z < most_z
            if inside and depth > nearest_m:
                seen[int(x), int(y), int(z)] = True


@compiled
def mark_before(
    along_x: NDArray[np.float32],
    along_y: NDArray[np.float32],
    along_z: NDArray[np.float32],
    k: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    nearest_m: np.float32,
    seen: NDArray[np.bool_],
) -> None:
    """Mark the voxels whose centres are not behind what a camera's pixel shows there.

    Args:
        along_x: ``(3, X)`` what a voxel's place along the first axis adds to its centre's place
            to the right, down and along the camera's axis (m).
        along_y, along_z: ``(3, Y)`` and ``(3, Z)`` likewise.
        k: ``(3, 3)`` intrinsics.
        depth_m: ``(H, W)`` along the axis.
        nearest_m: what is nearer to the camera's plane is not seen.
        seen: ``(X, Y, Z)``, set.
    """
    height, width = depth_m.shape
    fx, cx, fy, cy = k[0, 0], k[0, 2], k[1, 1], k[1, 2]
    from_right, from_below = np.float32(width) - cx, np.float32(height) - cy
    top = seen.shape[2] - 1
    for x in range(seen.shape[0]):
        for y in range(seen.shape[1]):
            right_xy = along_x[0, x] + along_y[0, y]
            down_xy = along_x[1, x] + along_y[1, y]
            ahead_xy = along_x[2, x] + along_y[2, y]
            # All three grow, or fall, along a column: its ends tell whether it is in the picture.
            first, last = ahead_xy + along_z[2, 0], ahead_xy + along_z[2, top]
            farthest = max(first, last)
            if farthest <= nearest_m:
                continue
            right_0, right_1 = (right_xy + along_z[0, 0]) * fx, (right_xy + along_z[0, top]) * fx
            if from_right >= 0 and min(right_0, right_1) >= from_right * farthest:
                continue
            if cx >= 0 and max(right_0, right_1) < -cx * farthest:
                continue
            for z in range(seen.shape[2]):
                ahead = ahead_xy + along_z[2, z]
                right = (right_xy + along_z[0, z]) * fx
                down = (down_xy + along_z[1, z]) * fy
                if (
                    ahead > nearest_m
                    and right >= -cx * ahead
                    and right < from_right * ahead
                    and down >= -cy * ahead
                    and down < from_below * ahead
                ):
                    column = min(int(right / ahead + cx), width - 1)
                    row = min(int(down / ahead + cy), height - 1)
                    seen[x, y, z] = ahead <= depth_m[row, column]
