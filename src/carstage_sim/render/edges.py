"""Which pixels one ray does not do justice to: edges of objects, of sides, and of contrast.

Most are **rough**: more rays go through them. Where all around is like the pixel itself, one
triangle or a crown with what shows between its leaves, more rays would meet what the pixels beside
it show already: such an **even** pixel becomes the weighted mean of the nine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.caster import SQUARE, Hits, RayCaster, picture_packets
from carstage_sim.render.crew import do, do_step
from carstage_sim.render.film import EVEN, develop_even
from carstage_sim.render.packet_simd import PACKET
from carstage_sim.render.quality import Sampling
from carstage_sim.render.scene import Frame
from carstage_sim.render.simd import lowest_bit
from carstage_sim.render.surface import is_leaf
from carstage_sim.render.vector_code import LANES, pixels_apart

_BAND = 8192
"""Pixels per piece of work, in whole rows."""
_SQUARES = 128
"""Squares of pixels per piece of work."""
_BENT = np.float32(0.9)
"""Cosine between the normals of two neighbours below which they show different sides."""
_MOTTLED = 5
"""Of the twelve pairs of pixels side by side in a square of nine, those that a leaf differs in from
what is no leaf: an edge that runs straight through has at most four."""
_ROUGH = 1
"""Mark of a pixel, as :data:`EVEN`; 0 for those that one ray does justice to."""


@device
def _apart(codes, y, x, v, u):  # type: ignore[no-untyped-def]
    """Largest difference of two pixels' codes."""
    most = np.int32(0)
    for channel in range(3):
        # As signed numbers: the compiler takes the difference of unsigned ones for unsigned.
        one, other = np.int32(codes[y, x, channel]), np.int32(codes[v, u, channel])
        most = np.maximum(most, abs(one - other))
    return most


@device
def _unlike(static, actors, row, triangle, i, j):  # type: ignore[no-untyped-def]
    """Whether two hits are on different objects, materials or sides."""
    if row[i] != row[j]:
        return True
    if triangle[i] == triangle[j]:
        return False
    surfaces = static if row[i] < 0 else actors
    a, b = triangle[i], triangle[j]
    if surfaces.object_id[a] != surfaces.object_id[b]:
        return True
    if surfaces.material[a] != surfaces.material[b]:
        return True
    f = surfaces.flat
    return f[a, 0] * f[b, 0] + f[a, 1] * f[b, 1] + f[a, 2] * f[b, 2] < _BENT


@device
def _mark(static, actors, row, triangle, codes, strong, weak, first, last, marked):  # type: ignore[no-untyped-def]
    """Mark the pixels of some rows, and those right below, that differ too much from a neighbour.

    Bands that run side by side may both mark a pixel, with the same mark.
    """
    height, width = codes.shape[0], codes.shape[1]
    for y in range(first, last):
        for below in range(2):
            v, end = y + below, width - 1 + below
            if v >= height:
                continue
            x = 0
            while x < end:
                i, j = y * width + x, v * width + x + 1 - below
                if x + LANES <= end:
                    apart = pixels_apart(codes, i, j, weak)
                    far = pixels_apart(codes, i, j, strong)
                    x += LANES
                else:
                    most = _apart(codes, y, x, v, x + 1 - below)
                    apart, far = int(most > weak), int(most > strong)
                    x += 1
                while apart:
                    k = lowest_bit(apart)
                    apart &= apart - 1
                    if (far >> k) & 1 or _unlike(static, actors, row, triangle, i + k, j + k):
                        marked[i + k] = _ROUGH
                        marked[j + k] = _ROUGH


@device
def _even_with(static, actors, detail, row, triangle, i, j):  # type: ignore[no-untyped-def]
    """Whether two hits are on one triangle, or both on leaves."""
    if row[i] != row[j]:
        return False
    if triangle[i] == triangle[j]:
        return triangle[i] >= 0
    surfaces = static if row[i] < 0 else actors
    a, b = surfaces.material[triangle[i]], surfaces.material[triangle[j]]
    return is_leaf(detail[a]) and is_leaf(detail[b])


@device
def alike(static, actors, detail, row, triangle, i, j):  # type: ignore[no-untyped-def]
    """Whether two hits are on one side of one object, or both on leaves, or both on nothing."""
    if not _unlike(static, actors, row, triangle, i, j):
        return True
    return _even_with(static, actors, detail, row, triangle, i, j)


@device
def _leaf_at(static, actors, detail, row, triangle, i):  # type: ignore[no-untyped-def]
    """1 where a pixel shows a leaf, else 0."""
    if triangle[i] < 0:
        return 0
    surfaces = static if row[i] < 0 else actors
    return 1 if is_leaf(detail[surfaces.material[triangle[i]]]) else 0


@device
def _is_even(row, triangle, leaf, i, width):  # type: ignore[no-untyped-def]
    """Whether a pixel and the eight around it show one triangle, or leaves with gaps all over.

    ``leaf`` has 1 where a pixel shows one. A crown's border, which leaves are on one side of, is
    none of that.
    """
    same = triangle[i] >= 0
    for v in range(-1, 2):
        for u in range(-1, 2):
            j = i + v * width + u
            same = same and row[j] == row[i] and triangle[j] == triangle[i]
    if same:
        return True
    changes, leaves = 0, 0
    left_above, above, right_above = 0, 0, 0
    for v in range(-1, 2):
        j = i + v * width
        left, here, right = int(leaf[j - 1]), int(leaf[j]), int(leaf[j + 1])
        changes += abs(left - here) + abs(here - right)
        if v > -1:
            changes += abs(left - left_above) + abs(here - above) + abs(right - right_above)
        leaves += left + here + right
        left_above, above, right_above = left, here, right
    return leaves == 9 or changes >= _MOTTLED


@device
def _mark_part(  # type: ignore[no-untyped-def]
    static, actors, detail, row, triangle, codes, strong, weak, leaf, marked, worker, first, last
):
    _mark(static, actors, row, triangle, codes, strong, weak, first, last, marked)
    if leaf.shape[0]:
        width = codes.shape[1]
        for i in range(first * width, last * width):
            leaf[i] = _leaf_at(static, actors, detail, row, triangle, i)


@device
def _find_even(row, triangle, leaf, width, height, first, last, marked):  # type: ignore[no-untyped-def]
    """Mark those rough pixels of some rows for which what is around them does."""
    for y in range(max(first, 1), min(last, height - 1)):
        for x in range(1, width - 1):
            i = y * width + x
            if marked[i] and _is_even(row, triangle, leaf, i, width):
                marked[i] = EVEN


@device
def _even_part(  # type: ignore[no-untyped-def]
    row, triangle, leaf, film, colours, pixels, marked, places, worker, first, last
):
    """Find, and develop, the even pixels of some rows of squares; count the rough ones."""
    height, width = pixels.shape[0], pixels.shape[1]
    above, below = first * SQUARE, min(last * SQUARE, height)
    if leaf.shape[0]:
        _find_even(row, triangle, leaf, width, height, above, below, marked)
        if colours.shape[0]:
            flat = pixels.reshape(-1, 4)
            develop_even(film, colours, marked, width, above * width, below * width, flat)
    across = (width + SQUARE - 1) // SQUARE
    for square in range(first * across, last * across):
        x, y = square % across * SQUARE, square // across * SQUARE
        count = 0
        for v in range(y, min(y + SQUARE, height)):
            for i in range(v * width + x, v * width + min(x + SQUARE, width)):
                count += marked[i] == _ROUGH
        places[square, 0] = count


@device
def _place(places, room, begins):  # type: ignore[no-untyped-def]
    """Turn counts of squares into where their pixels and groups go; the sums come last."""
    count, groups = 0, 0
    squares = places.shape[0] - 1
    for square in range(squares):
        here = places[square, 0]
        places[square, 0], places[square, 1] = count, groups
        count += here
        groups += (here + room - 1) // room
    places[squares, 0], places[squares, 1] = count, groups
    begins[groups] = count


@device
def _gather_part(  # type: ignore[no-untyped-def]
    marked, order, starts, room, places, edges, begins, worker, first, last
):
    """Numbers of the rough pixels of some squares, in groups of at most ``room``."""
    for square in range(first, last):
        at, group = places[square, 0], places[square, 1]
        if places[square + 1, 0] == at:
            continue
        left = 0
        for place in range(starts[square], starts[square + 1]):
            if marked[order[place]] != _ROUGH:
                continue
            if not left:
                begins[group] = at
                group, left = group + 1, room
            edges[at] = order[place]
            at, left = at + 1, left - 1


@kernel
def _find_rough(data, board, job, work):  # type: ignore[no-untyped-def]
    """Mark pixels, find those that are even, and gather those that are rough.

    The data are those of the three parts, and the items are the rows.
    """
    marking, even, gathering = data
    do(_mark_part, marking, board, job, work)
    rows = (work[1] + SQUARE - 1) // SQUARE
    do_step(_even_part, even, board, job, work, 1, rows, max(work[2] // SQUARE, 1))
    room, places, begins = gathering[3], gathering[4], gathering[6]
    _place(places, room, begins)
    do_step(_gather_part, gathering, board, job, work, 2, places.shape[0] - 1, _SQUARES)


class Rough(NamedTuple):
    """Pixels of a picture that one ray does not do justice to.

    Attributes:
        pixels: ``(E,)`` int32 numbers of those to be sampled again.
        begins: ``(G + 1,)`` int32 where in ``pixels`` groups begin whose rays run side by side.
        marks: ``(H * W,)`` uint8, ``EVEN`` for those that become a mean of nine.
    """

    pixels: NDArray[np.int32]
    begins: NDArray[np.int32]
    marks: NDArray[np.uint8]


def rough_pixels(
    caster: RayCaster,
    frame: Frame,
    detail: NDArray[np.uint8],
    hits: Hits,
    codes: NDArray[np.uint8],
    sampling: Sampling,
    film: tuple[NDArray[np.uint8], NDArray[np.float32]] | None = None,
) -> Rough:
    """Look for them.

    Args:
        caster: runs the kernels.
        frame: what was seen.
        detail: ``(M,)`` uint8 pattern of each material.
        hits: of the pixel centres, row by row.
        codes: ``(H, W, 4)`` uint8 of the pixel centres; even ones are developed anew.
        sampling: from which differences, and how many rays each gets.
        film: codes of its gamma, and ``(H * W, 3)`` float32 colours; None leaves even pixels alone.
    """
    height, width = codes.shape[:2]
    marks = np.zeros(height * width, np.uint8)
    leaf = np.empty(height * width if sampling.blend else 0, np.int8)
    rows = max(_BAND // width, 1)
    marking = (
        frame.static, frame.actors, detail, hits.row, hits.triangle, codes,
        sampling.strong, sampling.weak, leaf, marks,
    )  # fmt: skip
    gamma, colours = film or (np.empty(0, np.uint8), np.empty((0, 3), np.float32))
    squares = picture_packets(width, height)
    places = np.empty((len(squares.starts), 2), np.int32)
    pixels = np.empty(height * width, np.int32)
    begins = np.empty(height * width + 1, np.int32)
    room = max(PACKET // len(sampling.offsets), 1)
    even = hits.row, hits.triangle, leaf, gamma, colours, codes, marks, places
    gathering = marks, squares.order, squares.starts, room, places, pixels, begins
    caster.in_parts(_find_rough, (marking, even, gathering), height, rows)
    count, groups = places[-1]
    return Rough(pixels[:count], begins[: groups + 1], marks)
