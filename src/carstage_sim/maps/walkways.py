"""Where pedestrians walk, as convex polygons that join edge to edge.

Walkways are sidewalks, ramps and crosswalks. The strip of a sidewalk next to the kerb is left to
trees, lamps and poles; walkers keep to the rest and cross the strip at the ramps. Crosswalks
without ramps are linked with the paths near their ends, and have a step at the kerb.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.crossings import crossings
from carstage_sim.maps.drape import Drape
from carstage_sim.maps.partition import Partition, partition
from carstage_sim.maps.surfaces import KERB_HEIGHT_M, RAMP_LENGTH_M, Ramp, Surfaces

FURNITURE_ZONE_M = 1.5
"""Width of the strip along the kerb that belongs to trees and poles."""
_NARROW_ZONE_M = 1.2
"""Its width where the sidewalk is so narrow that little is left: poles only."""
_NARROW_PATH_M = 0.8
_POST_CLEARANCE_M = 0.4
_WALL_CLEARANCE_M = 0.3
_CROSSWALK_CLEARANCE_M = 0.3
_STEP_M = 0.4
"""A walker steps up onto the kerb within this."""
_TILE_M = 25.0
_MOST_CORNERS = 6
"""What a Detour polygon can hold."""


@dataclass(frozen=True, slots=True)
class Walkways:
    """Convex polygons of the walkable surface.

    Attributes:
        points: ``(P, 3)`` m.
        polygons: corner indices of each, clockwise in CARLA's x, y, at most six; neighbours share
            whole edges.
        is_crosswalk: per polygon.
    """

    points: NDArray[np.float64]
    polygons: tuple[tuple[int, ...], ...]
    is_crosswalk: tuple[bool, ...]


def walkways(
    ground: Surfaces,
    drape: Drape,
    cuts: Sequence[BaseGeometry] = (),
    posts: Sequence[tuple[float, float]] = (),
) -> Walkways | None:
    """The walkable polygons of a level, at the heights of its mesh; None without any.

    Args:
        ground: the level's areas.
        drape: its heights.
        cuts: lines along which the mesh is cut.
        posts: x, y of poles, which may stand beside crossings and in bends.
    """
    ramps = [_narrowed(ramp) for ramp in ground.ramps]
    paths = _paths(ground)
    ramped, plain = [], []
    for walk in ground.crosswalks:
        own = [ramp for ramp in ground.ramps if ramp.area.distance(walk) < 0.01]
        if len(own) > 1:
            ramped.append(_shrunk_along_travel(walk, own))
        else:
            plain.append(walk)
    paved = shapely.union_all([ground.road, ground.sidewalk, ground.median, ground.islands])
    stepped = crossings(plain, road=ground.road, paved=paved, paths=paths)
    links = shapely.union_all([crossing.to_paths for crossing in stepped])
    taken = shapely.union_all([_around(post) for post in posts])
    paths, links = paths.difference(taken), links.difference(taken)
    areas: list[BaseGeometry] = [
        shapely.union_all([*ramped, *(crossing.on_road for crossing in stepped)]),
        *(lower for lower, _ in ramps),
        shapely.union_all([paths, links, *(upper for _, upper in ramps)]),
    ]
    if all(area.is_empty for area in areas):
        return None
    steps = [links.buffer(_STEP_M).boundary.intersection(areas[0])] if stepped else []
    plan = partition(areas, _TILE_M, [*cuts, *steps])
    heights: NDArray[np.float64] = np.full(len(plan.points), KERB_HEIGHT_M)
    for index, ramp in enumerate(ground.ramps, start=1):
        corners = np.unique(plan.triangles[plan.area == index])
        heights[corners] = ramp.height(plan.points[corners])
    on_road, on_paths = (np.unique(plan.triangles[plan.area == k]) for k in (0, len(ramps) + 1))
    heights[np.setdiff1d(on_road, on_paths)] = 0.0
    heights += drape.height(plan.points)
    polygons, area = _convex_polygons(plan)
    return Walkways(
        points=np.concatenate([plan.points, heights[:, None]], axis=1),
        polygons=tuple(polygons),
        is_crosswalk=tuple(index == 0 for index in area),
    )


def joined(parts: Sequence[Walkways]) -> Walkways | None:
    """Walkways of several levels as one; equal points become one. None without any."""
    if len(parts) < 2:
        return parts[0] if parts else None
    points = np.concatenate([part.points for part in parts]).round(3)
    places, index = np.unique(points, axis=0, return_inverse=True)
    shifts = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    number = index.reshape(-1)
    return Walkways(
        points=places,
        polygons=tuple(
            tuple(int(number[corner + shift]) for corner in polygon)
            for part, shift in zip(parts, shifts.tolist(), strict=True)
            for polygon in part.polygons
        ),
        is_crosswalk=tuple(flag for part in parts for flag in part.is_crosswalk),
    )


def _paths(ground: Surfaces) -> BaseGeometry:
    """Sidewalks without the strip at the kerb and the margin at the walls."""
    inner = ground.road.union(ground.sidewalk).buffer(-_WALL_CLEARANCE_M, join_style="mitre")
    walked = inner.intersection(ground.sidewalk)
    clear = walked.difference(ground.road.buffer(FURNITURE_ZONE_M))
    half = 0.5 * _NARROW_PATH_M
    wide = clear.buffer(-half).buffer(half + FURNITURE_ZONE_M)
    narrow = walked.difference(ground.road.buffer(_NARROW_ZONE_M)).difference(wide)
    simple: BaseGeometry = shapely.set_precision(clear.union(narrow).simplify(0.05), 0.001)
    return simple


def _around(post: tuple[float, float]) -> BaseGeometry:
    x, y = post
    reach = _POST_CLEARANCE_M
    return shapely.box(x - reach, y - reach, x + reach, y + reach)


def _narrowed(ramp: Ramp) -> tuple[shapely.Polygon, shapely.Polygon]:
    """The walkable part of a ramp and of the flat piece between it and the path behind."""
    foot, up = np.array(ramp.foot), np.array(ramp.direction)
    across = np.array([-up[1], up[0]])
    reach = (shapely.get_coordinates(ramp.area) - foot) @ across
    left, right = reach.min() + _CROSSWALK_CLEARANCE_M, reach.max() - _CROSSWALK_CLEARANCE_M

    def rectangle(low_m: float, high_m: float) -> shapely.Polygon:
        corners = ((low_m, left), (high_m, left), (high_m, right), (low_m, right))
        return shapely.Polygon([tuple(foot + u * up + v * across) for u, v in corners])

    # The flat piece overlaps the path a little, so that the two fuse.
    return rectangle(0.0, RAMP_LENGTH_M), rectangle(RAMP_LENGTH_M, FURNITURE_ZONE_M + 0.2)


def _shrunk_along_travel(walk: BaseGeometry, ramps: list[Ramp]) -> BaseGeometry:
    """The crosswalk between its ramps' walkable parts."""
    lower = [_narrowed(ramp)[0] for ramp in ramps]
    return shapely.union_all(lower).convex_hull.intersection(walk)


def _convex_polygons(plan: Partition) -> tuple[list[tuple[int, ...]], list[int]]:
    """Fuses triangles of one area, longest shared edge first, while they stay convex."""
    polygons: dict[int, list[int]] = {
        i: [int(v) for v in triangle[::-1]] for i, triangle in enumerate(plan.triangles)
    }
    sides = {(polygon[k - 1], polygon[k]): i for i, polygon in polygons.items() for k in range(3)}
    shared = [(a, b) for a, b in sides if a < b and (b, a) in sides]
    lengths = [float(np.linalg.norm(plan.points[a] - plan.points[b])) for a, b in shared]
    for _, (a, b) in sorted(zip(lengths, shared, strict=True), key=lambda e: (-e[0], e[1])):
        one, two = sides[a, b], sides[b, a]
        if one == two or plan.area[one] != plan.area[two]:
            continue
        fused = _fused(polygons[one], polygons[two], a, b)
        if len(fused) > _MOST_CORNERS or not _is_convex(plan.points[fused]):
            continue
        for k in range(len(polygons[two])):
            sides[polygons[two][k - 1], polygons[two][k]] = one
        polygons[one] = fused
        del polygons[two]
    return [tuple(p) for p in polygons.values()], [int(plan.area[i]) for i in polygons]


def _fused(one: list[int], two: list[int], a: int, b: int) -> list[int]:
    """``one`` has the edge a→b, ``two`` has b→a: the outline of both together."""
    i, j = one.index(a), two.index(b)
    return [*one[i + 1 :], *one[: i + 1], *(two[j + 1 :] + two[:j])[1:]]


def _is_convex(corners: NDArray[np.float64]) -> bool:
    if len(np.unique(corners, axis=0)) < len(corners):
        return False
    before = corners - np.roll(corners, 1, axis=0)
    after = np.roll(corners, -1, axis=0) - corners
    turns = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return bool((turns <= 1e-9).all())
