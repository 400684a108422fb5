"""Areas made narrower along their outline.

GEOS 3.13 loses holes when it buffers a ring by a negative distance or a closed line: a sidewalk
round a block then covers the block. Here the strip along the outline is put together from a
quadrilateral for each edge, and taken away.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_MITRE_LIMIT = 5.0
"""A pointed corner moves by at most so many distances, as with GEOS."""
_SHORTEST_M = 1e-9


def shrunk(area: BaseGeometry, distance_m: float) -> BaseGeometry:
    """The area without what lies within a distance of its outline; corners stay pointed.

    Args:
        area: polygons, or an empty geometry.
        distance_m: above 0.
    """
    rings = shapely.get_rings(shapely.get_parts(area))
    if not len(rings):
        return area
    edges = np.concatenate([_strip(shapely.get_coordinates(ring), distance_m) for ring in rings])
    pieces = np.asarray(shapely.convex_hull(shapely.multipoints(np.asarray(shapely.points(edges)))))
    return area.difference(shapely.union_all(pieces[shapely.area(pieces) > 0.0]))


def _strip(ring: NDArray[np.float64], distance_m: float) -> NDArray[np.float64]:
    """A quadrilateral along the inner side of each edge of a ring.

    Args:
        ring: ``(N, 2)`` m, the first point again at the end.
        distance_m: width of the strip on the left hand, and on the right hand.

    Returns:
        ``(E, 4, 2)`` m.
    """
    start, step = ring[:-1], np.diff(ring, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    kept = length > _SHORTEST_M
    start, along = start[kept], step[kept] / length[kept, None]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    before = np.roll(left, 1, axis=0)
    # The corner of both offset edges lies along the sum of their normals.
    bisector = left + before
    squared = np.einsum("ij,ij->i", bisector, bisector)
    size = np.sqrt(np.maximum(squared, _SHORTEST_M))
    reach = np.minimum(2.0 / size, _MITRE_LIMIT) / size
    corner = bisector * (reach * distance_m)[:, None]
    ends, after = np.roll(start, -1, axis=0), np.roll(corner, -1, axis=0)
    return np.stack([start - corner, start + corner, ends + after, ends - after], axis=1)
