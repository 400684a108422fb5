"""The one Delaunay triangulation of faces, whatever triangulation one begins with.

Edges are flipped until no point lies in the circle round a neighbouring triangle (Lawson 1977).
All is counted in whole numbers, and where four points lie on one circle the diagonal at the point
of lowest number wins, so the result does not depend on the library that drew the first triangles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_Integers = NDArray[np.int64]
_ROUNDING = 1e-12
"""Share of a determinant's terms that float64 can be wrong by, with a wide margin."""


def delaunay(
    points: _Integers, triangles: _Integers, face: _Integers
) -> tuple[_Integers, _Integers]:
    """Flip edges inside the faces until all of them are Delaunay; outlines of faces stay.

    Args:
        points: ``(P, 2)`` whole steps of a grid, sorted by x, then y, each place once.
        triangles: ``(T, 3)`` indices into ``points``, counter-clockwise, sorted by face.
        face: ``(T,)`` the face that each triangle is a part of.

    Returns:
        Their triangles ``(T, 3)``, and the face of each ``(T,)``, without those of no area: the
        lowest index first in each, and those of a face in the order of their indices.
    """
    result = triangles.copy()
    while True:
        first, second, quads = _neighbours(result, face)
        flipped = _to_flip(points, quads)
        first, second, quads = first[flipped], second[flipped], quads[flipped]
        if not len(quads):
            return _sorted(points, result, face)
        # Each triangle takes part in one flip at a time.
        number = np.arange(len(quads))
        earliest = np.full(len(result), len(quads))
        np.minimum.at(earliest, first, number)
        np.minimum.at(earliest, second, number)
        free = (earliest[first] == number) & (earliest[second] == number)
        a, u, b, w = quads[free].T
        result[first[free]] = np.stack([a, u, b], axis=1)
        result[second[free]] = np.stack([a, b, w], axis=1)


def _neighbours(triangles: _Integers, face: _Integers) -> tuple[_Integers, _Integers, _Integers]:
    """Pairs of triangles of one face that share an edge.

    Returns:
        Their numbers, and ``(Q, 4)`` the corners a, u, b, w of both, counter-clockwise: the edge
        is u to w, a and b lie opposite.
    """
    count = len(triangles)
    tail = triangles[:, [1, 2, 0]].reshape(-1)
    head = triangles[:, [2, 0, 1]].reshape(-1)
    owner = np.repeat(np.arange(count), 3)
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    order = np.lexsort((owner, high, low, face[owner]))
    one, two = order[:-1], order[1:]
    shared = (
        (low[one] == low[two])
        & (high[one] == high[two])
        & (face[owner[one]] == face[owner[two]])
        & (tail[one] != tail[two])
    )
    one, two = one[shared], two[shared]
    opposite = triangles.reshape(-1)
    quads = np.stack([opposite[one], tail[one], opposite[two], head[one]], axis=1)
    return owner[one], owner[two], quads


def _to_flip(points: _Integers, quads: _Integers) -> NDArray[np.bool_]:
    """Whether the other diagonal, a to b, is the right one."""
    a, u, b, w = (points[quads[:, k]] for k in range(4))
    convex = (_turn(a, u, b) > 0) & (_turn(a, b, w) > 0)
    inside = _in_circle(a, u, w, b)
    lower = np.minimum(quads[:, 0], quads[:, 2]) < np.minimum(quads[:, 1], quads[:, 3])
    answer: NDArray[np.bool_] = convex & ((inside > 0) | ((inside == 0) & lower))
    return answer


def _turn(a: _Integers, b: _Integers, c: _Integers) -> _Integers:
    """Twice the area of triangles, above 0 where they are counter-clockwise."""
    ab, ac = b - a, c - a
    area: _Integers = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    return area


def _in_circle(a: _Integers, b: _Integers, c: _Integers, d: _Integers) -> _Integers:
    """Sign of the in-circle determinant: 1 where d lies inside the circle through a, b, c."""
    corners = np.stack([a - d, b - d, c - d], axis=1)
    terms = _terms(corners.astype(np.float64))
    sign: _Integers = np.sign(terms.sum(axis=1)).astype(np.int64)
    unsure = np.abs(terms.sum(axis=1)) <= _ROUNDING * np.abs(terms).sum(axis=1)
    exact = _terms(corners[unsure].astype(object)).sum(axis=1)
    sign[unsure] = np.sign(exact.astype(np.float64)).astype(np.int64)
    return sign


def _terms(corners: NDArray[Any]) -> NDArray[Any]:
    """The six products of the determinant; ``corners`` are ``(Q, 3, 2)``."""
    x, y = corners[..., 0], corners[..., 1]
    lifted = x * x + y * y
    return np.stack(
        [
            sign * lifted[:, i] * x[:, j] * y[:, k]
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
            for sign, j, k in ((1, j, k), (-1, k, j))
        ],
        axis=1,
    )


def _sorted(
    points: _Integers, triangles: _Integers, face: _Integers
) -> tuple[_Integers, _Integers]:
    solid = _turn(*(points[triangles[:, k]] for k in range(3))) > 0
    triangles, face = triangles[solid], face[solid]
    turns = (np.argmin(triangles, axis=1)[:, None] + np.arange(3)) % 3
    rotated = np.take_along_axis(triangles, turns, axis=1)
    order = np.lexsort((rotated[:, 2], rotated[:, 1], rotated[:, 0], face))
    return rotated[order], face[order]
