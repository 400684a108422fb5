"""Square tiles of a picture, and their boxes merged into the picture's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.simulator.detectors.layers import Array
from benchmarks.simulator.detectors.matching import LEAST_SCORE, FoundBox, overlaps

_OVERLAP = 0.25
"""Share of a tile that its neighbour has, too, at least."""
_SAME_IOU = 0.5
"""Boxes of one class that overlap by more are of one object."""
_BORDER = 0.02
"""Share of a tile: a box that ends so near the tile's border may be of an object's part."""
_GREY = 114
"""Beside a picture that is no square, as YOLO's are trained with."""


class Detector(Protocol):
    """A network that looks at square tiles."""

    side: int
    """Of the tiles (px)."""

    def detect(self, tile: Array) -> tuple[Array, Array]:
        """Boxes ``(N, 4)`` as x0, y0, x1, y1 (px of the tile) and ``(N, classes)`` scores."""
        ...


def tiles(width: int, height: int, side: int) -> list[tuple[int, int, int]]:
    """Left, top and side (px) of squares that cover a picture.

    Squares of the picture's height; squares of the network's side, which it sees unscaled; and one
    around the whole picture, as no other shows all of a bus that is near.
    """
    sides = sorted({min(width, height), min(side, width, height)}, reverse=True)
    return [
        (left, top, one)
        for one in [*sides, *[max(width, height)] * (width != height)]
        for top in _starts(height, one)
        for left in _starts(width, one)
    ]


def _starts(length: int, side: int) -> list[int]:
    """Where tiles of a side begin, the last one at the end."""
    count = 1 + math.ceil(max(length - side, 0) / (side * (1.0 - _OVERLAP)))
    return [round(k) for k in np.linspace(0, length - side, count)]


def detect_on_tiles(
    detector: Detector, picture: NDArray[np.uint8], names: tuple[str, ...]
) -> list[FoundBox]:
    """What a detector finds on a picture, each object once.

    Args:
        detector: the network.
        picture: ``(H, W, 3)`` sRGB.
        names: of its classes.
    """
    found: dict[int, list[tuple[Array, Array]]] = {}
    for boxes, scores in _by_tile(detector, picture):
        best = scores.argmax(axis=1)
        top = scores.max(axis=1)
        for kind in np.unique(best[top >= LEAST_SCORE]):
            chosen = (best == kind) & (top >= LEAST_SCORE)
            found.setdefault(int(kind), []).append((boxes[chosen], top[chosen]))
    return [
        FoundBox(names[kind], float(score), box)
        for kind, parts in sorted(found.items())
        for box, score in _strongest(*map(np.concatenate, zip(*parts, strict=True)))
    ]


def _by_tile(detector: Detector, picture: NDArray[np.uint8]) -> Iterator[tuple[Array, Array]]:
    """Boxes in the picture and their scores, tile by tile, without those that a border cuts."""
    height, width = picture.shape[:2]
    squares = tiles(width, height, detector.side)
    for left, top, side in squares:
        part = picture[top : top + side, left : left + side]
        beyond = [(0, side - length) for length in part.shape[:2]]
        cut = Image.fromarray(np.pad(part, [*beyond, (0, 0)], constant_values=_GREY))
        tile = cut.resize((detector.side, detector.side), Image.Resampling.BILINEAR)
        boxes, scores = detector.detect(np.asarray(tile, np.float32))
        boxes = boxes * np.float32(side / detector.side)
        corner = np.array([left, top, left, top], np.float32)
        whole = _holds((left, top, side), boxes + corner, width, height)
        if side > height or side > width:
            # All that a smaller square shows whole is looked at there.
            for smaller in squares[:-1]:
                whole = whole & ~_holds(smaller, boxes + corner, width, height)
        boxes = (boxes + corner)[whole]
        boxes = np.clip(boxes, 0.0, np.array([width, height, width, height], np.float32))
        yield boxes.astype(np.float32), scores[whole]


def _holds(tile: tuple[int, int, int], boxes: Array, width: int, height: int) -> NDArray[np.bool_]:
    """Which boxes of the picture end within a tile, but for where the picture ends."""
    left, top, side = tile
    low = np.array([left, top], np.float32)
    margin = side * _BORDER
    ends = (boxes[:, :2] < low + margin) & (low > 0)
    ends |= (boxes[:, 2:] > low + side - margin) & (np.array([width, height]) - low > side)
    return np.asarray(~ends.any(axis=1), np.bool_)


def _strongest(boxes: Array, scores: Array) -> Iterator[tuple[Array, float]]:
    """The boxes that no stronger one overlaps by much."""
    order = np.argsort(-scores, kind="stable")
    while len(order):
        first, order = order[0], order[1:]
        yield boxes[first], scores[first]
        order = order[overlaps(boxes[first][None], boxes[order])[0] <= _SAME_IOU]
