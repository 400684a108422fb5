"""Letters of shop signs: strokes of one width along lines and arcs, drawn for this program.

A glyph is a few paths on a grid whose capitals are 14 high and whose strokes are 2 wide. Arcs are
chains of points 30 degrees apart, the cosines given as numbers, so that bytes are the same on all
machines.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Point = tuple[float, float]
Quad = tuple[Point, Point, Point, Point]

_HEIGHT = 14.0
_PLAIN = 2.0
_APART = 2.6
_COSINES = (1.0, 0.8660254, 0.5, 0.0, -0.5, -0.8660254, -1.0, -0.8660254, -0.5, 0.0, 0.5, 0.8660254)


class _Arc(NamedTuple):
    """Middle, radii, and first and last angle in steps of 30 degrees."""

    x: float
    y: float
    rx: float
    ry: float
    first: int
    last: int

    def points(self) -> list[Point]:
        step = 1 if self.last >= self.first else -1
        return [
            (self.x + self.rx * _COSINES[k % 12], self.y + self.ry * _COSINES[(k - 3) % 12])
            for k in range(self.first, self.last + step, step)
        ]


_Path = tuple[Point | _Arc, ...]
_STEM: _Path = ((1, 0), (1, 14))
_GLYPHS: dict[str, tuple[float, tuple[_Path, ...]]] = {
    "A": (10, (((1, 0), (4.6, 14)), ((9, 0), (5.4, 14)), ((2.4, 4.2), (7.6, 4.2)))),
    "B": (9.6, (
        _STEM, ((1, 13), (5, 13), _Arc(5, 10.1, 3, 2.9, 3, -3), (1, 7.2)),
        ((1, 7.2), (5.4, 7.2), _Arc(5.4, 4.1, 3.2, 3.1, 3, -3), (1, 1)),
    )),
    "C": (9.6, ((_Arc(5, 9, 4, 4, 1, 6), _Arc(5, 5, 4, 4, 6, 11)),)),
    "D": (9.6, (
        _STEM,
        ((1, 13), (4.4, 13), _Arc(4.4, 9, 4.2, 4, 3, 0), _Arc(4.4, 5, 4.2, 4, 0, -3), (1, 1)),
    )),
    "E": (8, (_STEM, ((1, 13), (8, 13)), ((1, 7.1), (7.2, 7.1)), ((1, 1), (8, 1)))),
    "F": (7.8, (_STEM, ((1, 13), (7.8, 13)), ((1, 7), (7, 7)))),
    "G": (10, ((_Arc(5, 9, 4, 4, 1, 6), _Arc(5, 5, 4, 4, 6, 12), (9, 6.9), (5.4, 6.9)),)),
    "H": (10, (_STEM, ((9, 0), (9, 14)), ((1, 7), (9, 7)))),
    "I": (2, (_STEM,)),
    "J": (7, (((6, 14), _Arc(3.5, 3.5, 2.5, 2.5, 0, -5)),)),
    "K": (9.4, (_STEM, ((8.4, 14), (1.6, 5.4)), ((4.2, 8.4), (8.6, 0)))),
    "L": (7.6, (_STEM, ((1, 1), (7.6, 1)))),
    "M": (12, (_STEM, ((11, 0), (11, 14)), ((1.2, 14), (6, 3.6)), ((10.8, 14), (6, 3.6)))),
    "N": (10, (_STEM, ((9, 0), (9, 14)), ((1.3, 13.8), (8.7, 0.2)))),
    "O": (10.8, ((_Arc(5.4, 9, 4.4, 4, 0, 6), _Arc(5.4, 5, 4.4, 4, 6, 12), (9.8, 9)),)),
    "P": (9.2, (_STEM, ((1, 13), (5, 13), _Arc(5, 9.6, 3.2, 3.4, 3, -3), (1, 6.2)))),
    "Q": (10.8, (
        (_Arc(5.4, 9, 4.4, 4, 0, 6), _Arc(5.4, 5, 4.4, 4, 6, 12), (9.8, 9)), ((6.2, 4.2), (9.8, 0)),
    )),
    "R": (9.4, (
        _STEM, ((1, 13), (5, 13), _Arc(5, 9.6, 3.2, 3.4, 3, -3), (1, 6.2)), ((4.8, 6.4), (8.4, 0)),
    )),
    "S": (9.2, ((_Arc(4.6, 10, 3.6, 3, 1, 9), _Arc(4.6, 4, 3.6, 3, 3, -5)),)),
    "T": (9, (((0, 13), (9, 13)), ((4.5, 0), (4.5, 13)))),
    "U": (10, (((1, 14), _Arc(5, 5, 4, 4, 6, 12), (9, 14)),)),
    "V": (9.6, (((0.9, 14), (4.5, 0)), ((8.7, 14), (5.1, 0)))),
    "W": (14, (
        ((0.9, 14), (3.7, 0)), ((6.9, 13), (4.1, 0)),
        ((7.1, 13), (9.9, 0)), ((13.1, 14), (10.3, 0)),
    )),
    "X": (9.4, (((1, 14), (8.4, 0)), ((8.4, 14), (1, 0)))),
    "Y": (9.6, (((0.9, 14), (4.8, 6.2)), ((8.7, 14), (4.8, 6.2)), ((4.8, 6.8), (4.8, 0)))),
    "Z": (8.8, (((0.6, 13), (8.4, 13)), ((7.5, 13), (1.3, 1)), ((0.4, 1), (8.4, 1)))),
    "0": (9, ((_Arc(4.5, 9, 3.5, 4, 0, 6), _Arc(4.5, 5, 3.5, 4, 6, 12), (8, 9)),)),
    "1": (5, (((0.6, 10.8), (3.8, 13.2)), ((4, 0), (4, 14)))),
    "2": (8.4, ((_Arc(4.3, 9.6, 3.4, 3.4, 5, -1), (1.4, 1.6)), ((0.4, 1), (8, 1)))),
    "3": (8.4, (
        (_Arc(4, 10.2, 3.1, 2.8, 5, -3), (3.4, 7.4)), ((3.4, 7.4), _Arc(4, 4.2, 3.4, 3.2, 3, -5)),
    )),
    "4": (9, (((6.6, 0), (6.6, 14)), ((6.2, 13.6), (1, 4.2)), ((0.2, 4), (9, 4)))),
    "5": (8.6, (((7.6, 13), (1.8, 13), (1.5, 7.3), _Arc(4.4, 4.7, 3.5, 3.7, 4, -5)),)),
    "6": (9, (
        (_Arc(4.5, 9, 3.5, 4, 1, 6), (1, 4.4)), (_Arc(4.5, 4.4, 3.5, 3.4, 0, 12),),
    )),
    "7": (8.4, (((0.4, 13), (8.2, 13)), ((7.4, 13), (3, 0)))),
    "8": (8.8, ((_Arc(4.4, 10.2, 3, 2.8, 0, 12),), (_Arc(4.4, 4.2, 3.4, 3.2, 0, 12),))),
    "9": (9, (
        (_Arc(4.5, 9.6, 3.5, 3.4, 0, 12),), ((8, 9.6), _Arc(4.5, 5, 3.5, 4, 0, -5)),
    )),
    " ": (4.6, ()),
}  # fmt: skip


@cache
def _glyph(letter: str, weight: float) -> tuple[float, tuple[Quad, ...]]:
    """Width of a letter, and quads on the grid, their strokes ``weight`` wide."""
    width, paths = _GLYPHS[letter]
    quads: list[Quad] = []
    for path in paths:
        points: list[Point] = []
        for piece in path:
            points += piece.points() if isinstance(piece, _Arc) else [piece]
        quads += _stroke(points, weight / 2.0)
    return width, tuple(quads)


def _stroke(points: list[Point], half: float) -> list[Quad]:
    """A path as quads that share their mitred ends; two points at one place are one."""
    line = np.array([p for k, p in enumerate(points) if k == 0 or p != points[k - 1]], np.float64)
    along = np.diff(line, axis=0)
    along /= np.sqrt((along**2).sum(axis=1, keepdims=True))
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    closed = bool(np.abs(line[0] - line[-1]).max() < 1e-9)
    before = np.concatenate([across[-1:] if closed else across[:1], across])
    after = np.concatenate([across, across[:1] if closed else across[-1:]])
    mitre = before + after
    # As far from the corner as keeps the stroke's width, at most twice that of a straight one.
    mitre /= np.maximum((mitre * after).sum(axis=1, keepdims=True), 0.5)
    left, right = (line + half * mitre).tolist(), (line - half * mitre).tolist()
    return [
        (tuple(right[k]), tuple(right[m]), tuple(left[m]), tuple(left[k]))
        for k, m in pairwise(range(len(line)))
    ]


def written(text: str, height: float, *, weight: float = _PLAIN, wide: float = 1.0) -> list[Quad]:
    """A line of text out of strokes.

    Args:
        text: capitals, digits and blanks.
        height: of the letters, metres.
        weight: of the strokes; a height of 14 is a letter's.
        wide: width of the letters, 1 for usual ones.

    Returns:
        Corners ``(along, up)`` of quads, metres from the middle of the line, counterclockwise.
    """
    unit = height / _HEIGHT
    glyphs = [_glyph(letter, weight) for letter in text]
    length = sum(width for width, _ in glyphs) + _APART * (len(text) - 1)
    first, found = -length / 2.0, []
    for width, quads in glyphs:
        for quad in quads:
            a, b, c, d = (
                ((first + x) * wide * unit, min(max(y, 0.0), _HEIGHT) * unit - height / 2.0)
                for x, y in quad
            )
            found.append((a, b, c, d))
        first += width + _APART
    return found
