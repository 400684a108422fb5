"""The vector map as triangles, made once per town."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.grid import GridPose
from carstage.birds_eye.layers import lane_bits, layer_bit, marking_bits
from carstage.geometry import FloatArray
from carstage.vector_map import VectorMap

STOP_LINE_WIDTH_M: Final = 0.4
MARKING_WIDTH_M: Final = 0.12
"""Of markings of which the map does not say how wide they are."""


@dataclass(frozen=True, slots=True, eq=False)
class TownShapes:
    """``N`` triangles of a town.

    Attributes:
        corners: ``(N, 3, 3)`` in the world (m).
        bits: ``(N,)`` the layers that each belongs to.
        is_ground: ``(N,)`` whether it is a piece of a lane, which says how high the ground is.
        low, high: ``(N, 2)`` least and largest x and y.
    """

    corners: FloatArray
    bits: NDArray[np.uint32]
    is_ground: NDArray[np.bool_]
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, town: VectorMap, resolution_m: float) -> TownShapes:
        """The shapes of a town.

        Lines narrower than a cell are made as wide as one, so that they have no gaps.

        Args:
            town: the vector map.
            resolution_m: side of a cell.
        """
        parts = [(np.zeros((0, 3, 3)), 0, False), *_shapes(town, resolution_m)]
        counts = [len(corners) for corners, _, _ in parts]
        corners = np.concatenate([corners for corners, _, _ in parts])
        return cls(
            corners,
            np.repeat(np.array([bits for _, bits, _ in parts], np.uint32), counts),
            np.repeat(np.array([ground for _, _, ground in parts], np.bool_), counts),
            corners[:, :, :2].min(axis=1),
            corners[:, :, :2].max(axis=1),
        )

    def near(self, pose: GridPose, radius_m: float) -> NDArray[np.int64]:
        """Which triangles may lie within a distance of the ego."""
        place = np.array([pose.x_m, pose.y_m])
        inside = (self.low <= place + radius_m) & (self.high >= place - radius_m)
        return np.flatnonzero(inside[:, 0] & inside[:, 1])


def _shapes(town: VectorMap, resolution_m: float) -> Iterator[tuple[FloatArray, int, bool]]:
    for lane in town.lanes:
        bits = lane_bits(lane.type, in_junction=lane.junction_id is not None)
        if bits:
            yield _strip(lane.left_boundary, lane.right_boundary), bits, True
    for mark in town.markings:
        bits = marking_bits(mark.type)
        if bits and len(mark.line) > 1:
            width_m = max(mark.width_m or MARKING_WIDTH_M, resolution_m)
            yield _ribbon(mark.line, width_m), bits, False
    for walk in town.crosswalks:
        yield _polygon(walk.outline), layer_bit("crosswalk"), False
    for stop in town.stop_lines:
        if len(stop.line) > 1:
            width_m = max(STOP_LINE_WIDTH_M, resolution_m)
            yield _ribbon(stop.line, width_m), layer_bit("stop_line"), False


def _strip(left: FloatArray, right: FloatArray) -> FloatArray:
    """``(2 N - 2, 3, 3)`` triangles between two lines of ``N`` points."""
    one = np.stack([left[:-1], left[1:], right[1:]], axis=1)
    other = np.stack([left[:-1], right[1:], right[:-1]], axis=1)
    return np.concatenate([one, other])


def _ribbon(line: FloatArray, width_m: float) -> FloatArray:
    """Triangles of a line of some width; its bends are mitred."""
    step = np.diff(line[:, :2], axis=0)
    size = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2)
    moves = size > 0.0
    line, step, size = line[np.append(moves, True)], step[moves], size[moves]
    if not len(step):
        return np.zeros((0, 3, 3))
    along = step / size[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    before = np.concatenate([normal[:1], normal])
    after = np.concatenate([normal, normal[-1:]])
    # The mitre of two unit normals is their sum over 1 + their product; no longer than twice.
    product = before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1]
    mitre = (before + after) / np.maximum(1.0 + product, 0.5)[:, None]
    offset = np.zeros_like(line)
    offset[:, :2] = mitre * (width_m / 2.0)
    return _strip(line - offset, line + offset)


def _polygon(outline: FloatArray) -> FloatArray:
    """Triangles of a closed outline, by cutting ears off; crosswalks have a few corners."""
    ring = outline[:-1] if np.array_equal(outline[0], outline[-1]) else outline
    x, y = ring[:, 0], ring[:, 1]
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    left = list(range(len(ring))) if area > 0.0 else list(range(len(ring)))[::-1]
    found: list[list[int]] = []
    while len(left) > 3:
        for place in range(len(left)):
            ear = [left[place - 1], left[place], left[(place + 1) % len(left)]]
            if _is_ear(ring, ear, left):
                break
        else:
            break  # it crosses itself: what is left becomes a fan
        found.append(ear)
        left.remove(ear[1])
    found += [[left[0], left[i], left[i + 1]] for i in range(1, len(left) - 1)]
    return ring[np.array(found, np.int64).reshape(-1, 3)]


def _is_ear(ring: FloatArray, ear: list[int], others: list[int]) -> bool:
    a, b, c = (ring[i, :2] for i in ear)
    if _turn(a, b, c) <= 0.0:
        return False
    return not any(
        _turn(a, b, p) >= 0.0 and _turn(b, c, p) >= 0.0 and _turn(c, a, p) >= 0.0
        for p in (ring[i, :2] for i in others if i not in ear)
    )


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Twice the area of a triangle, positive where it turns from x to y."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
