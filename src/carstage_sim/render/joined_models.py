"""Models of actors one behind the other in the arrays that rays and shading read.

A model is added where the last one ends, and frames that are under way go on reading what was there
before: to copy all models anew for each that comes took longer than to draw.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Geometry, empty_geometry

_FIRST_NODES, _FIRST_TRIANGLES = 1 << 17, 1 << 20
"""What there is room for at first. Memory is used as rows come; to make room takes a copy."""


class Surfaces(NamedTuple):
    """What triangles look like and mean; row = triangle number of a :class:`Geometry`.

    Attributes:
        normals: ``(T, 3, 3)`` float32 unit normals per corner.
        material: ``(T,)`` uint8 values of :class:`carstage_sim.mesh.Material`.
        tag: ``(T,)`` uint8 values of :class:`carstage_sim.labels.CityObjectLabel`.
        object_id: ``(T,)`` uint32 level object + 1, 0 for none.
        flat: ``(T, 3)`` float32 unit normals of the triangles themselves.
        pane: ``(T,)`` uint16: 1 and 2 for the two halves of a pane's rectangle or a wall's, else
            0; plus 4 times its width and 512 times its height in decimetres, 127 at most.
    """

    normals: NDArray[np.float32]
    material: NDArray[np.uint8]
    tag: NDArray[np.uint8]
    object_id: NDArray[np.uint32]
    flat: NDArray[np.float32]
    pane: NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A mesh by itself, as rays and shading need it.

    Attributes:
        geometry: its hierarchy and triangles.
        surfaces: of its triangles.
        bounds: ``(2, 3)`` float32 lowest and highest corner.
        corners: ``(T, 3, 3)`` float32 of its triangles.
    """

    geometry: Geometry
    surfaces: Surfaces
    bounds: NDArray[np.float32]
    corners: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A model's triangles, as hits of a frame number them.

    Attributes:
        first: number of its first triangle in the actors' geometry.
        corners: ``(T, 3, 3)`` float32 corners of its triangles, actor's frame; the same array
            again for the same model.
    """

    first: int
    corners: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """Where a model is among the others.

    Attributes:
        nodes, blocks, triangles: its range in the arrays.
        bounds: as in :class:`Model`.
        shape: its triangles.
    """

    nodes: slice
    blocks: slice
    triangles: slice
    bounds: NDArray[np.float32]
    shape: Shape

    @property
    def root(self) -> int:
        """Number of its first node."""
        return int(self.nodes.start)


class _Rows:
    """An array that grows at its end; what somebody reads of it stays as it is."""

    def __init__(self, like: NDArray[Any], room: int) -> None:
        self._rows = np.empty((room, *like.shape[1:]), like.dtype)
        self.count = 0

    def add(self, rows: NDArray[Any]) -> slice:
        """Where the rows are from now on."""
        begin, end = self.count, self.count + len(rows)
        if end > len(self._rows):
            wider = np.empty((max(2 * len(self._rows), end), *rows.shape[1:]), rows.dtype)
            wider[:begin] = self._rows[:begin]
            self._rows = wider
        self._rows[begin:end] = rows
        self.count = end
        return slice(begin, end)

    @property
    def all(self) -> NDArray[Any]:
        """Those that were added."""
        return self._rows[: self.count]


class JoinedModels:
    """Arrays of many models; one thread at a time changes them."""

    def __init__(self) -> None:
        self._geometry = [_Rows(array, _FIRST_NODES) for array in empty_geometry()]
        self._surfaces = [_Rows(array, _FIRST_TRIANGLES) for array in empty_surfaces()]
        self._view: tuple[Geometry, Surfaces] | None = None

    @property
    def triangles(self) -> int:
        """How many there are of all models that were added."""
        return self._surfaces[0].count

    def arrays(self) -> tuple[Geometry, Surfaces]:
        """What was added until now; the same arrays again while nothing is."""
        if self._view is None:
            self._view = (
                Geometry(*(rows.all for rows in self._geometry)),
                Surfaces(*(rows.all for rows in self._surfaces)),
            )
        return self._view

    def add(self, model: Model) -> Joined:
        """Put a model behind the others."""
        nodes, blocks = self._geometry[0].count, self._geometry[2].count
        first, g = self.triangles, model.geometry
        inner = g.children >= 0
        children = np.where(inner, g.children + nodes, g.children - blocks).astype(np.int32)
        numbers = np.where(g.numbers >= 0, g.numbers + first, -1).astype(np.int32)
        moved = g._replace(children=children, numbers=numbers)
        places = _added(self._geometry, moved)
        of_triangles = _added(self._surfaces, model.surfaces)
        self._view = None
        shape = Shape(first, model.corners)
        return Joined(places[0], places[2], of_triangles[0], model.bounds, shape)

    def model(self, joined: Joined) -> Model:
        """A model that was added, by itself again."""
        geometry, surfaces = self.arrays()
        nodes, blocks, first = joined.root, int(joined.blocks.start), joined.shape.first
        children = geometry.children[joined.nodes]
        numbers = geometry.numbers[joined.blocks]
        return Model(
            Geometry(
                geometry.planes[joined.nodes],
                np.where(children >= 0, children - nodes, children + blocks),
                geometry.corners[joined.blocks],
                np.where(numbers >= 0, numbers - first, -1),
                geometry.cells[joined.blocks],
            ),
            Surfaces._make(array[joined.triangles] for array in surfaces),
            joined.bounds,
            joined.shape.corners,
        )


def _added(rows: Sequence[_Rows], arrays: Iterable[NDArray[Any]]) -> list[slice]:
    """Where each array is in its rows from now on."""
    return [into.add(array) for into, array in zip(rows, arrays, strict=True)]


def empty_surfaces() -> Surfaces:
    """Of no triangles."""
    return Surfaces(
        np.empty((0, 3, 3), np.float32),
        np.empty(0, np.uint8),
        np.empty(0, np.uint8),
        np.empty(0, np.uint32),
        np.empty((0, 3), np.float32),
        np.empty(0, np.uint16),
    )
