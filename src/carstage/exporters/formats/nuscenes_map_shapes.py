"""The layers node, line and polygon of nuScenes's map expansion; places that meet share a node."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, Final

import numpy as np
import shapely

from carstage.exporters.formats.nuscenes_tables import token
from carstage.geometry import FloatArray

GRID_M: Final = 0.01
"""Nodes are whole centimetres; those less than two apart are one."""
_PER_M: Final = round(1.0 / GRID_M)

Area = shapely.Polygon


class MapShapes:
    """Shapes of one town in nuScenes's map frame: x east, y north, from (0, 0) on.

    Attributes:
        size_m: width and height of the canvas.

    Args:
        town: what tokens follow from.
        shift_m: what is added to east and north.
        size_m: see above.
    """

    def __init__(
        self, town: str, shift_m: tuple[float, float], size_m: tuple[float, float]
    ) -> None:
        self.size_m = size_m
        self._town, self._shift_m = town, np.array(shift_m)
        self._nodes: dict[tuple[int, int], str] = {}
        self._lines: list[dict[str, Any]] = []
        self._polygons: list[dict[str, Any]] = []

    def layers(self) -> dict[str, list[dict[str, Any]]]:
        """The three layers as they are written."""
        nodes = [
            {"token": name, "x": x / _PER_M, "y": y / _PER_M}
            for (x, y), name in self._nodes.items()
        ]
        return {"node": nodes, "line": self._lines, "polygon": self._polygons}

    def token(self, *parts: object) -> str:
        """A token of the town's map."""
        return token("map", self._town, *parts)

    def flat(self, places: FloatArray) -> FloatArray:
        """``(N, 2)`` of the map's frame from ``(N, 3)`` of the world."""
        return np.asarray(places[:, :2] * (1.0, -1.0) + self._shift_m)

    def on_canvas(self, places: FloatArray) -> bool:
        """Whether the rectangle around places ``(N, 3)`` of the world reaches into the canvas."""
        flat = self.flat(places)
        return bool((flat.max(axis=0) >= 0.0).all() and (flat.min(axis=0) <= self.size_m).all())

    def snapped(self, flat: FloatArray) -> FloatArray:
        """``(N, 2)`` places moved to their nodes."""
        return np.array([self._key(x, y) for x, y in flat.tolist()], np.float64) / _PER_M

    def nodes(self, flat: Iterable[Sequence[float]]) -> list[str]:
        """Tokens of the nodes at places."""
        return [self._nodes[self._key(place[0], place[1])] for place in flat]

    def area(self, outline: FloatArray) -> Area | None:
        """The area within a ring ``(N, 2)``, on nodes; of one that crosses itself the largest part.

        None: there is none.
        """
        ring = self.snapped(outline)
        moves = np.any(ring != np.roll(ring, 1, axis=0), axis=1)
        if moves.sum() < 3:
            return None
        found = shapely.Polygon(ring[moves])
        if not found.is_valid:
            found = max(
                polygons_of(shapely.make_valid(found)), key=_size, default=shapely.Polygon()
            )
        return None if found.is_empty or found.area < GRID_M**2 else found

    def add_line(self, flat: FloatArray) -> str:
        """A line of nodes; returns its token."""
        nodes = self.nodes(flat)
        kept = [node for at, node in enumerate(nodes) if not at or node != nodes[at - 1]]
        name = self.token("line", len(self._lines))
        self._lines.append({"token": name, "node_tokens": kept if len(kept) > 1 else nodes})
        return name

    def add_polygon(self, area: Area) -> str:
        """An area with its holes; returns its token."""
        rings = [self.nodes(ring.coords[:-1]) for ring in (area.exterior, *area.interiors)]
        name = self.token("polygon", len(self._polygons))
        holes = [{"node_tokens": ring} for ring in rings[1:]]
        self._polygons.append({"token": name, "exterior_node_tokens": rings[0], "holes": holes})
        return name

    def _key(self, x: float, y: float) -> tuple[int, int]:
        """The node at a place, made where none is near."""
        key = round(x * _PER_M), round(y * _PER_M)
        if key in self._nodes:
            return key
        for dx, dy in product((-1, 0, 1), repeat=2):
            near = key[0] + dx, key[1] + dy
            if near in self._nodes:
                return near
        self._nodes[key] = self.token("node", *key)
        return key


def polygons_of(shape: shapely.Geometry) -> list[Area]:
    """The polygons that a shape is or holds."""
    parts = shapely.get_parts(shape).tolist()
    nested = [polygons_of(part) for part in parts if hasattr(part, "geoms")]
    plain = [part for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]
    return [*plain, *(one for some in nested for one in some)]


def joined(areas: Iterable[Area]) -> list[Area]:
    """Areas that touch as one, with holes; in an order that follows from where they are."""
    together = shapely.union_all(list(areas), grid_size=GRID_M)
    return sorted(polygons_of(together), key=lambda area: area.bounds)


def _size(area: Area) -> float:
    return float(area.area)
