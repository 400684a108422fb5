"""One frame's grids from what the dataset says of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.grid import Grid, GridPose, Integers
from carstage.birds_eye.layers import object_bit
from carstage.birds_eye.town import TownShapes
from carstage.birds_eye.visibility import (
    CAMERA,
    LIDAR,
    CameraView,
    Cloud,
    hit_cells,
    seen_by_camera,
)
from carstage.geometry import FloatArray, rotation_matrix

NO_HEIGHT_CM: Final = -(2**15)
_HIGHEST_CM: Final = 2**15 - 1


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Grids ``(H, W)`` of one frame, and the objects in them.

    Attributes:
        semantic: uint32, a bit for each layer.
        instance: uint16, from 1 the place of a track in ``track_id``; 0: no object.
        height_cm: int16 of the ground above the ego's pivot; ``NO_HEIGHT_CM``: not known.
        visible: uint8, bits ``CAMERA`` and ``LIDAR``.
        track_id: ``(N,)`` int64, ascending.
        velocity_m_s: ``(N, 2)`` float32 of the same tracks, forward and right of the ego.
    """

    semantic: NDArray[np.uint32]
    instance: NDArray[np.uint16]
    height_cm: NDArray[np.int16]
    visible: NDArray[np.uint8]
    track_id: NDArray[np.int64]
    velocity_m_s: NDArray[np.float32]


def draw_birds_eye(
    grid: Grid,
    pose: GridPose,
    town: TownShapes | None,
    objects: Sequence[Mapping[str, Any]],
    seen_tracks: Collection[int] = (),
    cameras: Sequence[CameraView] = (),
    clouds: Sequence[Cloud] = (),
) -> Drawn:
    """Draw the grids of one frame.

    Args:
        grid: the cells.
        pose: where they are.
        town: the vector map's shapes; None: no layer of the map, no height.
        objects: rows of ``objects.parquet`` of the frame.
        seen_tracks: objects that a labelled camera sees.
        cameras: labelled cameras.
        clouds: sweeps of the frame.
    """
    cells = grid.shape[0] * grid.shape[1]
    semantic, visible = np.zeros(cells, np.uint32), np.zeros(cells, np.uint8)
    height_m = np.full(cells, np.nan)
    if town is not None:
        _draw_town(grid, pose, town, semantic, height_m)
    instance, tracks, velocity = _draw_objects(grid, pose, objects, semantic)
    seen = np.isin(tracks, np.array(sorted(seen_tracks), np.int64))
    visible[np.append(False, seen)[instance]] |= CAMERA
    if cameras:
        bare = np.flatnonzero((instance == 0) & ~np.isnan(height_m))
        ground = _ground(grid, pose, bare, height_m[bare])
        for view in cameras:
            visible[bare[seen_by_camera(view, ground)]] |= CAMERA
    for cloud in clouds:
        visible[hit_cells(grid, pose, cloud)] |= LIDAR
    known = ~np.isnan(height_m)
    height_cm = np.full(cells, NO_HEIGHT_CM, np.int16)
    height_cm[known] = np.clip(np.rint(100.0 * height_m[known]), NO_HEIGHT_CM + 1, _HIGHEST_CM)
    shape = grid.shape
    return Drawn(
        semantic.reshape(shape),
        instance.reshape(shape),
        height_cm.reshape(shape),
        visible.reshape(shape),
        tracks,
        velocity,
    )


def _draw_town(
    grid: Grid,
    pose: GridPose,
    town: TownShapes,
    semantic: NDArray[np.uint32],
    height_m: FloatArray,
) -> None:
    """Draw the layers of the map, and how high lanes lie above the ego's pivot."""
    chosen = town.near(pose, grid.radius_m)
    # Where lanes lie above each other, the height is that of the one nearest to the ego's.
    apart = np.abs(town.corners[chosen, :, 2].sum(axis=1) - 3.0 * pose.z_m)
    chosen = chosen[np.argsort(-np.rint(apart * 1e3), kind="stable")]
    corners, bits = town.corners[chosen], town.bits[chosen]
    units = grid.units(pose.forward_right(corners))
    owner, cells = grid.covered(units)
    bits = bits[owner]
    for value in np.unique(town.bits[chosen]).tolist():
        semantic[cells[bits == value]] |= np.uint32(value)
    ground = town.is_ground[chosen][owner]
    owner, cells = owner[ground], cells[ground]
    planes = _planes(units, corners[:, :, 2] - pose.z_m)[owner]
    side = round(grid.resolution_m * 1e4)
    row, column = np.divmod(cells, grid.shape[1])
    x, y = column * side + side // 2, row * side + side // 2
    # Of a cell that comes twice, the last value stays: the nearest to the ego's height.
    height_m[cells] = planes[:, 0] + planes[:, 1] * x + planes[:, 2] * y


def _planes(units: Integers, z_m: FloatArray) -> FloatArray:
    """``(N, 3)`` of triangles: z = p0 + p1 x + p2 y, with x and y in the grid's units."""
    a, b, c = np.moveaxis(units, 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    area = ux * vy - vx * uy
    du, dv = z_m[:, 1] - z_m[:, 0], z_m[:, 2] - z_m[:, 0]
    safe = np.where(area == 0, 1, area)  # without area it covers no cell
    p1, p2 = (du * vy - dv * uy) / safe, (dv * ux - du * vx) / safe
    return np.stack([z_m[:, 0] - p1 * a[:, 0] - p2 * a[:, 1], p1, p2], axis=-1)


def _draw_objects(
    grid: Grid,
    pose: GridPose,
    objects: Sequence[Mapping[str, Any]],
    semantic: NDArray[np.uint32],
) -> tuple[NDArray[np.uint16], NDArray[np.int64], NDArray[np.float32]]:
    """Draw the boxes; gives ``(cells,)`` instances, ``(N,)`` tracks, ``(N, 2)`` velocities.

    A box covers what its middle plane covers, seen from above. Of several in a cell, the one with
    the highest top is the instance; all of them have their layers.
    """
    instance = np.zeros(len(semantic), np.uint16)
    drawn = [row for row in objects if row["box_center"] is not None and _bit(row)]
    drawn.sort(key=lambda row: row["track_id"])
    if not drawn:
        return instance, np.zeros(0, np.int64), np.zeros((0, 2), np.float32)
    center = np.array([row["box_center"] for row in drawn])
    extent = np.array([row["box_extent"] for row in drawn])
    axes = rotation_matrix([row["box_rotation_deg"] for row in drawn]) * extent[:, None, :]
    top = center[:, 2] + np.abs(axes[:, 2]).sum(axis=1)
    order = np.argsort(np.rint(top * 1e3), kind="stable")
    length, width = axes[order, :2, 0], axes[order, :2, 1]
    middle = center[order, :2]
    corners = np.stack(
        [middle + length + width, middle + length - width, middle - length - width,
         middle - length + width], axis=1,
    )  # fmt: skip
    units = grid.units(pose.forward_right(corners))
    triangles = units[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)
    owner, cells = grid.covered(triangles)
    number = order[owner // 2]
    bits = np.array([_bit(row) for row in drawn], np.uint32)
    for value in np.unique(bits).tolist():
        semantic[cells[bits[number] == value]] |= np.uint32(value)
    instance[cells] = number + 1  # ascending tops: the highest comes last and stays
    kept = np.unique(instance[instance > 0])
    places = np.zeros(len(drawn) + 1, np.uint16)
    places[kept] = np.arange(1, len(kept) + 1)
    tracks = np.array([row["track_id"] for row in drawn], np.int64)[kept - 1]
    velocity = pose.turned(np.array([row["velocity"] for row in drawn]))[kept - 1]
    return places[instance], tracks, velocity.astype(np.float32)


def _bit(row: Mapping[str, Any]) -> int:
    return object_bit(row["class"], is_ego=row["is_ego"])


def _ground(grid: Grid, pose: GridPose, cells: Integers, height_m: FloatArray) -> FloatArray:
    """``(N, 3)`` centres of cells on the ground, in the world."""
    row, column = np.divmod(cells, grid.shape[1])
    forward = grid.length_m / 2.0 - (row + 0.5) * grid.resolution_m
    right = (column + 0.5) * grid.resolution_m - grid.width_m / 2.0
    places = pose.world(np.stack([forward, right], axis=-1))
    return np.column_stack([places, height_m + pose.z_m])
