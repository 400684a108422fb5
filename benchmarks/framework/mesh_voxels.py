"""The surfaces of a scene as voxels of 0.05 m along a grid's own axes, made by trimesh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from carstage.occupancy import FREE, MOVABLE_TAGS, Occupancy

PITCH_M = 0.05
_EDGE_M = 0.025
"""Pieces of triangles whose area is added up."""
_TILE_M = 4.0
_FEW_VOXELS = 100
"""A class with fewer in a comparison says nothing."""
_TAGS = 32


@dataclass(frozen=True, slots=True)
class Surfaces:
    """Triangles of the world.

    Attributes:
        corners: ``(T, 3, 3)`` world metres.
        tags: ``(T,)``.
    """

    corners: NDArray[np.float64]
    tags: NDArray[np.uint8]


class MeshVoxels:
    """Compares the voxels of frames with triangles.

    A voxel is expected to be occupied if one of trimesh's smaller voxels in it is. Its expected tag
    is that of most surface: trimesh divides triangles into pieces of 0.025 m, of which each counts
    where its middle is.

    Args:
        near_m: how far around the origin of the voxels is compared; trimesh takes seconds.
    """

    def __init__(self, near_m: float) -> None:
        self._near_m = near_m
        self._both: dict[int | str, int] = defaultdict(int)
        self._either: dict[int | str, int] = defaultdict(int)

    def add(self, content: Occupancy, surfaces: Surfaces, left_out: NDArray[np.bool_]) -> None:
        """Compare a frame's voxels.

        Args:
            content: the voxels.
            surfaces: what should be in them; tags of road users go before those of the town.
            left_out: ``(X, Y, Z)`` what is not compared.
        """
        expected = self._expected(content, surfaces)
        near = (np.abs(content.centres()[..., :2]) < self._near_m).all(axis=-1)
        found, expected = content.semantic[near & ~left_out], expected[near & ~left_out]
        self._count("occupied", found != FREE, expected != FREE)
        for tag in np.union1d(found, expected).tolist():
            if tag != FREE:
                self._count(tag, found == tag, expected == tag)

    def ious(self) -> tuple[float, dict[int, float]]:
        """Of occupied voxels, and of each tag that occurs often enough."""
        shares = {n: self._both[n] / e for n, e in self._either.items() if e >= _FEW_VOXELS}
        return shares.get("occupied", 0.0), {n: s for n, s in shares.items() if isinstance(n, int)}

    def _count(self, name: int | str, found: NDArray[np.bool_], other: NDArray[np.bool_]) -> None:
        self._both[name] += int((found & other).sum())
        self._either[name] += int((found | other).sum())

    def _expected(self, content: Occupancy, surfaces: Surfaces) -> NDArray[np.uint8]:
        """``(X, Y, Z)``."""
        grid = content.grid
        occupied: NDArray[np.bool_] = np.zeros((grid.count, _TAGS), np.bool_)
        areas: NDArray[np.float64] = np.zeros((grid.count, _TAGS))
        for tag, triangles in self._tiles(content, surfaces):
            voxels = _mesh(triangles - PITCH_M / 2.0).voxelized(PITCH_M, max_iter=20).points
            cells, _ = grid.cells((voxels + PITCH_M / 2.0) / grid.side_m)
            occupied[cells, tag] = True
            pieces = _pieces(triangles, _EDGE_M)
            cells, inside = grid.cells(pieces.mean(axis=1) / grid.side_m)
            areas[:, tag] += np.bincount(cells, _areas(pieces[inside]), grid.count)
        movable = np.isin(np.arange(_TAGS), MOVABLE_TAGS)
        order = np.where(occupied, 1.0 + areas, 0.0) + 1e6 * (occupied & movable)
        tags = np.where(occupied.any(axis=1), order.argmax(axis=1), FREE).astype(np.uint8)
        return np.asarray(tags.reshape(grid.shape))

    def _tiles(self, content: Occupancy, surfaces: Surfaces) -> Iterator[tuple[int, NDArray[Any]]]:
        """Tags, and ``(N, 3, 3)`` triangles in metres from the grid's lower corner."""
        matrix = np.linalg.inv(content.world_from_frame)
        low = np.array(content.grid.low_m)
        world = np.c_[surfaces.corners.reshape(-1, 3), np.ones(3 * len(surfaces.corners))]
        corners = ((world @ matrix[:3].T) * [1, -1, 1] - low).reshape(-1, 3, 3)
        reach = self._near_m + content.grid.side_m
        least = np.array([-reach, -reach, -np.inf]) - [*low[:2], 0.0]
        most = np.array([reach, reach, content.grid.lengths_m[2]]) - [*low[:2], 0.0]
        least[2] = 0.0
        near = ((corners.min(axis=1) < most) & (corners.max(axis=1) > least)).all(axis=1)
        for tag in np.unique(surfaces.tags[near]).tolist():
            pieces = _pieces(corners[near & (surfaces.tags == tag)], _TILE_M / 4.0)
            inside = ((pieces.min(axis=1) < most) & (pieces.max(axis=1) > least)).all(axis=1)
            tiles = np.floor(pieces.mean(axis=1)[:, :2] / _TILE_M).astype(np.int64)
            for tile in np.unique(tiles[inside], axis=0):
                yield tag, pieces[inside & (tiles == tile).all(axis=1)]


def joined(parts: Iterable[Surfaces]) -> Surfaces:
    """All triangles of several."""
    kept = list(parts)
    return Surfaces(
        np.concatenate([part.corners for part in kept]), np.concatenate([p.tags for p in kept])
    )


def _mesh(triangles: NDArray[Any]) -> trimesh.Trimesh:
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False)


def _pieces(triangles: NDArray[Any], edge_m: float) -> NDArray[Any]:
    """``(N, 3, 3)`` triangles divided until no edge is longer."""
    subdivide: Any = trimesh.remesh.subdivide_to_size
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    vertices, faces = subdivide(triangles.reshape(-1, 3), faces, edge_m, max_iter=20)
    return np.asarray(vertices[faces])


def _areas(triangles: NDArray[Any]) -> NDArray[np.float64]:
    areas: Any = trimesh.triangles.area
    return np.asarray(areas(triangles))
