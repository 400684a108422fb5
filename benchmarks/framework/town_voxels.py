"""A built-in town's own meshes as voxels, made by trimesh at 0.05 m."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from carstage.occupancy import FREE, MOVABLE_TAGS, Occupancy
from carstage_sim.maps import MapCatalogue, Town

PITCH_M = 0.05
_TILE_M = 8.0
_EDGE_M = 2.0
"""Triangles are divided down to this before they are sorted into tiles."""
_FEW_VOXELS = 100
"""A class with fewer in a comparison says nothing."""


class TownVoxels:
    """Compares voxels with the triangles of a town.

    Args:
        name: of a built-in town.
        near_m: how far from the ego is compared, along each axis; trimesh takes seconds.
    """

    def __init__(self, name: str, near_m: float) -> None:
        town: Town = MapCatalogue().load(name)
        self._corners = town.static_mesh.vertices.astype(np.float64)[town.static_mesh.triangles]
        self._tags = town.static_mesh.tag
        self._near_m = near_m
        self._both: dict[str, int] = defaultdict(int)
        self._either: dict[str, int] = defaultdict(int)

    def add(self, content: Occupancy) -> None:
        """Compare a frame's voxels, those that a sensor sees and no road user is in."""
        expected = self._expected(content)
        movable = np.isin(expected, MOVABLE_TAGS) | (content.voxels.instance > 0)
        near = (np.abs(content.centres()[..., :2]) < self._near_m).all(axis=-1)
        kept = (content.seen > 0) & ~movable & near
        found, expected = content.semantic[kept], expected[kept]
        self._count("occupied", found != FREE, expected != FREE)
        for tag in np.union1d(found, expected).tolist():
            if tag != FREE:
                self._count(str(tag), found == tag, expected == tag)

    def ious(self) -> tuple[float, dict[str, float]]:
        """Of occupied voxels, and of each tag that occurs often enough."""
        shares = {n: self._both[n] / e for n, e in self._either.items() if e >= _FEW_VOXELS}
        return shares.pop("occupied", 0.0), shares

    def _count(self, name: str, found: NDArray[np.bool_], expected: NDArray[np.bool_]) -> None:
        self._both[name] += int((found & expected).sum())
        self._either[name] += int((found | expected).sum())

    def _expected(self, content: Occupancy) -> NDArray[np.uint8]:
        """``(X, Y, Z)`` the tag that most of trimesh's voxels in each have."""
        grid = content.grid
        votes: NDArray[np.int32] = np.zeros((grid.count, 32), np.int32)
        frame_from_world = np.linalg.inv(content.world_from_frame)
        for tag, points in self._points(content):
            local = (np.c_[points, np.ones(len(points))] @ frame_from_world[:3].T) * [1, -1, 1]
            cells = np.floor((local - np.array(grid.low_m)) / grid.side_m).astype(np.int64)
            cells = cells[((cells >= 0) & (cells < grid.shape)).all(axis=1)]
            flat = (cells[:, 0] * grid.shape[1] + cells[:, 1]) * grid.shape[2] + cells[:, 2]
            votes[:, tag] += np.bincount(flat, minlength=grid.count).astype(np.int32)
        tags = votes.argmax(axis=1).astype(np.uint8)
        tags[votes.max(axis=1) == 0] = FREE
        return np.asarray(tags.reshape(grid.shape))

    def _points(self, content: Occupancy) -> Iterator[tuple[int, NDArray[Any]]]:
        """Middles of trimesh's voxels, tag by tag and tile by tile."""
        middle, reach = content.world_from_frame[:3, 3], self._near_m * np.sqrt(2.0) + 1.0
        low, high = self._corners.min(axis=1), self._corners.max(axis=1)
        near = ((low[:, :2] < middle[:2] + reach) & (high[:, :2] > middle[:2] - reach)).all(axis=1)
        for tag in np.unique(self._tags[near]).tolist():
            corners = self._corners[near & (self._tags == tag)]
            subdivide: Any = trimesh.remesh.subdivide_to_size
            vertices, faces = subdivide(
                corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), _EDGE_M
            )
            triangles = vertices[faces]
            places = triangles.mean(axis=1)
            inside = (np.abs(places[:, :2] - middle[:2]) < reach).all(axis=1)
            tiles = np.floor(places[:, :2] / _TILE_M).astype(np.int64)
            for tile in np.unique(tiles[inside], axis=0):
                own = triangles[inside & (tiles == tile).all(axis=1)]
                mesh = trimesh.Trimesh(
                    own.reshape(-1, 3), np.arange(3 * len(own)).reshape(-1, 3), process=False
                )
                yield tag, mesh.voxelized(PITCH_M, max_iter=16).points
