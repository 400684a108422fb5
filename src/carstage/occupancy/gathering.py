"""Surfaces gathered over frames: cells with how often what was seen in them, and where.

Everything that is added up is a whole number, so the order of the frames changes nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.errors import AnnotationError
from carstage.geometry import FloatArray, invert_pose
from carstage.occupancy.grid import VoxelGrid, grid_from_world, placed
from carstage.occupancy.objects import MOVABLE_TAGS, owners, road_users
from carstage.occupancy.seeing import FINE, Picture, Surface, Sweep, seen_voxels, surface

_BITS: Final = 19
"""Of a cell's number along an axis; 6 more are the tag's."""
_TAG_BITS: Final = 6
_HALF: Final = 1 << (_BITS - 1)
_STEPS: Final = 256
"""To a cell's side, in which places are added up."""
_NAMES: Final = ("keys", "counts", "steps")


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Cells of one frame of reference, each with one tag; a cell may come with several.

    Attributes:
        keys: ``(N,)`` int64, ascending: x, y, z of the cell and the tag.
        counts: ``(N,)`` int64, in how many frames and sensors it was seen.
        steps: ``(N, 3)`` int64, the places within the cell, added up.
    """

    keys: NDArray[np.int64]
    counts: NDArray[np.int64]
    steps: NDArray[np.int64]

    @classmethod
    def of(cls, points: FloatArray, tags: NDArray[np.uint8], side_m: float) -> Cells:
        """The cells of points.

        Args:
            points: ``(N, 3)`` m.
            tags: ``(N,)``.
            side_m: of a cell.

        Raises:
            AnnotationError: a point is too far from the origin.
        """
        scaled = points / side_m
        cells = np.floor(scaled)
        if len(cells) and np.abs(cells).max() >= _HALF:
            raise AnnotationError(
                f"A surface is farther than {_HALF * side_m / 1e3:.0f} km from the map's origin.",
                "Use a larger labels.occupancy.resolution_m, or leave labels.occupancy out.",
            )
        steps = ((scaled - cells) * _STEPS).astype(np.int64)
        x, y, z = (cells.astype(np.int64) + _HALF).T
        keys = ((x << _BITS | y) << _BITS | z) << _TAG_BITS | tags.astype(np.int64)
        return _added_up(keys, np.ones(len(keys), np.int64), steps)

    @classmethod
    def together(cls, parts: Sequence[Cells]) -> Cells:
        """All that several have seen."""
        if len(parts) == 1:
            return parts[0]
        empty = cls(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3), np.int64))
        return _added_up(
            *(np.concatenate([getattr(part, name) for part in (empty, *parts)]) for name in _NAMES)
        )

    @property
    def tags(self) -> NDArray[np.int64]:
        """``(N,)``."""
        return self.keys & ((1 << _TAG_BITS) - 1)

    def points(self, side_m: float) -> FloatArray:
        """``(N, 3)`` where in each cell the surface was seen on average (m)."""
        mask = (1 << _BITS) - 1
        cells = self.keys >> _TAG_BITS
        found = np.stack([cells >> 2 * _BITS, cells >> _BITS & mask, cells & mask], axis=-1) - _HALF
        within = (self.steps + 0.5 * self.counts[:, None]) / (self.counts[:, None] * float(_STEPS))
        return np.asarray((found + within) * side_m)

    def between(self, low_m: FloatArray, high_m: FloatArray, side_m: float) -> Cells:
        """Those whose x lies between two bounds, and y too, to a cell's side."""
        first, last = (int(np.floor(bound / side_m)) + _HALF for bound in (low_m[0], high_m[0]))
        shift = 2 * _BITS + _TAG_BITS
        begin, end = np.searchsorted(self.keys, [first << shift, (last + 1) << shift])
        part = Cells(*(getattr(self, name)[begin:end] for name in _NAMES))
        y = (part.keys >> _BITS + _TAG_BITS & (1 << _BITS) - 1) - _HALF
        kept = (y >= np.floor(low_m[1] / side_m)) & (y <= np.floor(high_m[1] / side_m))
        return Cells(*(getattr(part, name)[kept] for name in _NAMES))


def _added_up(
    keys: NDArray[np.int64], counts: NDArray[np.int64], steps: NDArray[np.int64]
) -> Cells:
    if not len(keys):
        return Cells(keys, counts, steps)
    order = np.argsort(keys)  # of equal ones any order: whole numbers are added
    keys = keys[order]
    starts = np.flatnonzero(np.append(True, keys[1:] != keys[:-1]))
    sums = [_sums(column[order], starts) for column in (counts, *steps.T)]
    return Cells(keys[starts], sums[0], np.stack(sums[1:], axis=-1))


def _sums(values: NDArray[np.int64], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sums of the parts of ``values`` that begin at ``starts``, the first of them 0."""
    ends = np.cumsum(values)[np.append(starts[1:], len(values)) - 1]
    return np.asarray(np.diff(ends, prepend=0), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """Surfaces of some frames.

    Attributes:
        still: cells of the town, in the world.
        moving: cells of each road user by its track, in its box.
    """

    still: Cells
    moving: Mapping[int, Cells]

    @classmethod
    def together(cls, parts: Sequence[Gathered]) -> Gathered:
        """All that several have seen."""
        by_track: dict[int, list[Cells]] = defaultdict(list)
        for part in parts:
            for track, cells in part.moving.items():
                by_track[track].append(cells)
        return cls(
            Cells.together([part.still for part in parts]),
            {track: Cells.together(cells) for track, cells in sorted(by_track.items())},
        )


class Gathering:
    """Takes the surfaces of frames.

    Args:
        grid: the voxels.
    """

    def __init__(self, grid: VoxelGrid) -> None:
        self._grid = grid
        self._still: list[tuple[FloatArray, NDArray[np.uint8]]] = []
        self._moving: dict[int, list[tuple[FloatArray, NDArray[np.uint8]]]] = defaultdict(list)

    def add(
        self,
        world_from_frame: FloatArray,
        objects: Iterable[Mapping[str, Any]],
        seen: Sequence[Picture | Sweep],
    ) -> NDArray[np.uint8]:
        """Take a frame; gives ``(X, Y, Z)`` bits of the sensors that see each voxel.

        Args:
            world_from_frame: ``(4, 4)`` pose of what the voxels are around.
            objects: rows of ``objects.parquet``.
            seen: what sensors saw.
        """
        matrix = grid_from_world(world_from_frame)
        world_from_grid = invert_pose(matrix)
        users = road_users(objects)
        surfaces = [surface(self._grid, matrix, one) for one in seen]
        for found in surfaces:
            if found.tags is None:
                continue
            points = placed(world_from_grid, grid_points(self._grid, found))
            movable = np.isin(found.tags, MOVABLE_TAGS)
            self._still.append((points[~movable], found.tags[~movable]))
            points, tags = points[movable], found.tags[movable]
            owner = owners(points, users)
            for number in np.unique(owner[owner >= 0]).tolist():
                if users[number].row["is_ego"]:
                    continue
                own = owner == number
                local = placed(users[number].box_from_world, points[own])
                self._moving[users[number].track_id].append((local, tags[own]))
        return seen_voxels(self._grid, matrix, seen, surfaces)

    def end(self) -> Gathered:
        """What the frames have shown."""
        return Gathered(
            self._cells(self._still),
            {track: self._cells(parts) for track, parts in sorted(self._moving.items())},
        )

    def _cells(self, parts: Sequence[tuple[FloatArray, NDArray[np.uint8]]]) -> Cells:
        return Cells.of(
            np.concatenate([np.zeros((0, 3)), *(points for points, _ in parts)]),
            np.concatenate([np.zeros(0, np.uint8), *(tags for _, tags in parts)]),
            self._grid.side_m / FINE,
        )


def grid_points(grid: VoxelGrid, found: Surface) -> FloatArray:
    """``(N, 3)`` metres forward, left and up of a surface's points."""
    return np.asarray(found.points * grid.side_m + np.array(grid.low_m))
