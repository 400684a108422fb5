"""Debug shapes in the world: points and lines that live for some simulated seconds.

Arrows and boxes are lines by the time they get here. As in CARLA, RGB cameras see them and event
cameras, which show the same scene, and no other sensor does. The world only keeps count of their
lives.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.world.pose import Vector3

logger = logging.getLogger(__name__)

FOREVER_S = 0.0
"""A life of zero seconds never ends (CARLA's documentation of ``DebugHelper``)."""
_AT_MOST = 50_000
_ROUNDING_S = 1e-6

Rgb = tuple[int, int, int]
Segment = tuple[Vector3, Vector3]


@dataclass(frozen=True, slots=True)
class DebugShapes:
    """The shapes of one frame.

    Attributes:
        segments: ``(S, 2, 3)`` float64 ends in world metres; both ends of a point are its place.
        size: ``(S,)`` float32: width of a line in metres, side of a point in pixels.
        is_point: ``(S,)`` bool.
        colour: ``(S, 3)`` uint8 sRGB.
    """

    segments: NDArray[np.float64]
    size: NDArray[np.float32]
    is_point: NDArray[np.bool_]
    colour: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Shape:
    segment: Segment
    size: float
    is_point: bool
    colour: Rgb
    born_s: float
    life_s: float

    def outlives(self, now_s: float) -> bool:
        """Whether it is still there after the frame at ``now_s``."""
        return self.life_s == FOREVER_S or now_s + _ROUNDING_S < self.born_s + self.life_s


class DebugDrawing:
    """The shapes that live, oldest first; at most fifty thousand lines and points.

    Attributes:
        frame: the shapes of the current frame, None for none.
    """

    def __init__(self) -> None:
        self.frame: DebugShapes | None = None
        self._shapes: deque[_Shape] = deque()
        self._changed = False
        self._warned = False

    def point(
        self, place: Vector3, size_px: float, colour: Rgb, now_s: float, life_s: float
    ) -> None:
        """Draw a point, as wide on every picture."""
        self._add(_Shape((place, place), size_px, True, colour, now_s, life_s))

    def lines(
        self, segments: list[Segment], width_m: float, colour: Rgb, now_s: float, life_s: float
    ) -> None:
        """Draw lines."""
        for segment in segments:
            self._add(_Shape(segment, width_m, False, colour, now_s, life_s))

    def _add(self, shape: _Shape) -> None:
        if len(self._shapes) >= _AT_MOST:
            self._shapes.popleft()
            if not self._warned:
                self._warned = True
                logger.warning("more than %d debug shapes live: the oldest vanish", _AT_MOST)
        self._shapes.append(shape)
        self._changed = True

    def clear(self) -> None:
        """Take all shapes away."""
        self._shapes.clear()
        self.frame = None

    def step(self, now_s: float) -> None:
        """Begin a frame: forget the shapes whose life has ended, show the others.

        A shape is seen for at least one frame; a negative life is one frame's.
        """
        if self._changed:
            self.frame = _frozen(self._shapes)
        alive = deque(shape for shape in self._shapes if shape.outlives(now_s))
        self._changed = len(alive) < len(self._shapes)
        self._shapes = alive


def _frozen(shapes: Iterable[_Shape]) -> DebugShapes | None:
    shown = list(shapes)
    if not shown:
        return None
    return DebugShapes(
        np.array([shape.segment for shape in shown], np.float64),
        np.array([shape.size for shape in shown], np.float32),
        np.array([shape.is_point for shape in shown], np.bool_),
        np.array([shape.colour for shape in shown], np.uint8),
    )


def arrow(begin: Vector3, end: Vector3, head_m: float) -> list[Segment]:
    """The lines of an arrow: its shaft and four strokes of the head (CARLA's DebugShapeDrawer)."""
    start, tip = np.asarray(begin, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(tip - start))
    if length == 0.0:
        return [(begin, end)]
    forward = (tip - start) / length
    away = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    side = np.cross(away, forward)
    side /= np.linalg.norm(side)
    up = np.cross(forward, side)
    strokes = [(begin, end)]
    for right, above in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        x, y, z = (tip - head_m * forward + head_m * (right * side + above * up)).tolist()
        strokes.append(((x, y, z), end))
    return strokes


def box_edges(center: Vector3, extent: Vector3, rotation_deg: Vector3) -> list[Segment]:
    """The twelve edges of a box."""
    rotation = rotation_matrix(rotation_deg)
    corner = {}
    for x in (-1, 1):
        for y in (-1, 1):
            for z in (-1, 1):
                a, b, c = (np.asarray(center) + rotation @ (np.array([x, y, z]) * extent)).tolist()
                corner[x, y, z] = (a, b, c)
    return [
        (corner[one], corner[other])
        for one in corner
        for other in corner
        if one < other and sum(a != b for a, b in zip(one, other, strict=True)) == 1
    ]
