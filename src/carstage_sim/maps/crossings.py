"""Ways over the road along crosswalks that were not drawn to fit the sidewalks.

Crosswalks of CARLA's towns end up to some metres before the sidewalks or beyond their kerbs, and
some lie where nobody walks. Those with a path near both ends are of use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_REACH_M = 5.0
"""How far a path may be from the end of a crosswalk."""
_BESIDE_M = 2.0
_LEAST_ONWARD = 0.25
"""Cosine: farther than that to the side lies a path that the crosswalk runs along."""
_HALF_WIDTH_M = 0.8
"""Of the link between them."""
_INTO_THE_PATH_M = 0.2
_INTO_THE_CROSSWALK_M = 1.0
_SEAM_M = 0.1


@dataclass(frozen=True, slots=True)
class Crossing:
    """A way over the road.

    Attributes:
        on_road: its part between the kerbs.
        to_paths: its ends on the sidewalks.
    """

    on_road: BaseGeometry
    to_paths: BaseGeometry


def crossings(
    crosswalks: Sequence[shapely.Polygon],
    *,
    road: BaseGeometry,
    paved: BaseGeometry,
    paths: BaseGeometry,
) -> list[Crossing]:
    """The ways over the road along crosswalks, from path to path.

    Args:
        crosswalks: outlines.
        road: between the kerbs.
        paved: all that one may step on, the road too.
        paths: where people walk along the road.
    """
    if paths.is_empty:
        return []
    solid = paved.buffer(_SEAM_M, join_style="mitre")
    shapely.prepare(solid)
    found = []
    for crosswalk in crosswalks:
        core = crosswalk.intersection(paved)
        links = [_link(end, paths, solid) for end in _ends(core)]
        if links and all(links):
            way = shapely.union_all([core, *links]).intersection(paved)
            found.append(Crossing(way.intersection(road), way.difference(road)))
    return found


def _ends(area: BaseGeometry) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Middle of each end of a long area, and a point inside it, straight behind."""
    outline = area.minimum_rotated_rectangle
    if outline.is_empty or outline.geom_type != "Polygon":
        return []
    corners = shapely.get_coordinates(outline)[:4]
    sides = corners[1:3] - corners[:2]
    lengths = np.linalg.norm(sides, axis=1)
    along = int(np.argmax(lengths))
    middle, half = corners.mean(axis=0), 0.5 * sides[along]
    inner = half * (1.0 - min(_INTO_THE_CROSSWALK_M / (0.5 * float(lengths[along])), 1.0))
    return [(middle + sign * half, middle + sign * inner) for sign in (-1.0, 1.0)]


def _link(
    end: tuple[NDArray[np.float64], NDArray[np.float64]],
    paths: BaseGeometry,
    solid: BaseGeometry,
) -> BaseGeometry | None:
    """The strip from an end to the nearest path; None without one near, on paved ground."""
    at, inside = end
    near = np.array(shapely.shortest_line(shapely.Point(at), paths).coords)[1]
    away = near - at
    length = float(np.linalg.norm(away))
    if length > _REACH_M:
        return None
    onward = (at - inside) / max(float(np.linalg.norm(at - inside)), _SEAM_M)
    if length > _BESIDE_M and away @ onward < _LEAST_ONWARD * length:
        return None
    beyond = near + away * (_INTO_THE_PATH_M / length) if length > 0.0 else near
    line = shapely.LineString([inside, at, beyond])
    if not solid.contains(line):
        return None
    strip = line.buffer(_HALF_WIDTH_M, cap_style="flat", join_style="mitre")
    return strip.intersection(solid)
