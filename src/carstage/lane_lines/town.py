"""What of a vector map is looked for in pictures, made once per town."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray
from carstage.vector_map import StopLine, VectorMap
from carstage.vector_map.model import DRIVEN_TYPES

LineKind = Literal["marking", "boundary", "crosswalk", "stop_line", "painted_object"]
AREAS: Final = ("crosswalk", "stop_line", "painted_object")
"""Kinds whose places are the corners of an area, not a line."""
STEP_M: Final = 1.0
"""Two places of a line are no farther apart."""
STOP_LINE_DEPTH_M: Final = 0.4
_DOUBLE: Final = ("solid solid", "solid broken", "broken solid", "broken broken")


@dataclass(frozen=True, slots=True, eq=False)
class TownLine:
    """One line or area.

    Attributes:
        kind: what it is; a ``boundary`` is that of a driven lane where nothing is painted.
        map_id: its id in the vector map; of a boundary that of its lane and ``left`` or
            ``right``, of its later stretches with a number.
        type, colour: of a marking or a painted object as in the vector map; else empty.
        width_m: of a marking's paint, of double lines over both; of a stop line; else 0.
        places: ``(N, 3)`` in the world (m); of an area its corners, not closed.
    """

    kind: LineKind
    map_id: str
    type: str
    colour: str
    width_m: float
    places: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TownLines:
    """All of a town.

    Attributes:
        lines: in the order of the vector map.
        low, high: ``(N, 2)`` least and largest x and y of each.
    """

    lines: tuple[TownLine, ...]
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, town: VectorMap) -> TownLines:
        """The lines of a town."""
        lines = tuple(line for line in _lines(town) if len(line.places) > 1)
        empty = np.zeros((0, 2))
        low = np.array([line.places[:, :2].min(axis=0) for line in lines]).reshape(-1, 2)
        high = np.array([line.places[:, :2].max(axis=0) for line in lines]).reshape(-1, 2)
        return cls(lines, low if lines else empty, high if lines else empty)

    def near(self, place: FloatArray, range_m: float) -> Iterator[TownLine]:
        """Lines that may lie within a distance of a place ``(3,)``."""
        inside = (self.low <= place[:2] + range_m) & (self.high >= place[:2] - range_m)
        for number in np.flatnonzero(inside[:, 0] & inside[:, 1]).tolist():
            yield self.lines[number]


def _lines(town: VectorMap) -> Iterator[TownLine]:
    for mark in town.markings:
        # Two strokes with a gap as wide as each.
        strokes = 3.0 if mark.type in _DOUBLE else 1.0
        places = with_steps(mark.line)
        yield TownLine("marking", mark.id, mark.type, mark.colour, strokes * mark.width_m, places)
    driven = {lane.id for lane in town.lanes if lane.type in DRIVEN_TYPES}
    for lane in town.lanes:
        if lane.id not in driven or lane.junction_id is not None:
            continue
        for side, marks, line, neighbour in (
            ("left", lane.left_markings, lane.left_boundary, lane.left_neighbour),
            ("right", lane.right_markings, lane.right_boundary, lane.right_neighbour),
        ):
            if neighbour in driven and lane.id > neighbour:
                continue  # a boundary of two driven lanes is that of one of them
            stations = [town.marking_by_id[name].s_m for name in marks]
            for number, bare in enumerate(_bare(line, lane.s_m, stations)):
                name = f"{lane.id}/{side}" + (f"/{number}" if number else "")
                yield TownLine("boundary", name, "", "", 0.0, with_steps(bare))
    for walk in town.crosswalks:
        yield TownLine("crosswalk", walk.id, "", "", 0.0, walk.outline[:-1])
    for stop in town.stop_lines:
        corners = _stop_area(stop)
        yield TownLine("stop_line", stop.id, "", "", STOP_LINE_DEPTH_M, corners)
    for painted in town.painted_objects:
        corners = painted.outline[:-1]
        yield TownLine("painted_object", painted.id, painted.type, painted.colour, 0.0, corners)


def _bare(line: FloatArray, s_m: FloatArray, painted: Sequence[FloatArray]) -> Iterator[FloatArray]:
    """The stretches of a lane's boundary that no marking lies on.

    Args:
        line: ``(N, 3)`` the boundary.
        s_m: ``(N,)`` stations of its places.
        painted: the stations ``(2,)`` where each marking begins and ends.
    """
    between = (s_m[:-1] + s_m[1:]) / 2
    is_bare = np.ones(len(between), bool)
    for begin_m, end_m in painted:
        is_bare &= (between < begin_m) | (between > end_m)
    pieces = np.flatnonzero(is_bare)
    for run in np.split(pieces, np.flatnonzero(np.diff(pieces) > 1) + 1):
        if len(run):
            yield line[run[0] : run[-1] + 2]


def with_steps(line: FloatArray, step_m: float = STEP_M) -> FloatArray:
    """A line with more places on it, so that none is farther than a step from the next.

    Either ``(N, 2)`` or ``(N, 3)`` in, and out.
    Places where it does not move are left out.
    """
    step = np.diff(line, axis=0)
    size = np.sqrt((step**2).sum(axis=1))
    moves = size > 0.0
    begin, step, size = line[:-1][moves], step[moves], size[moves]
    if not len(step):
        return line[:1]
    pieces = np.ceil(size / step_m).astype(np.int64)
    index = np.repeat(np.arange(len(step)), pieces)
    first = np.concatenate([[0], np.cumsum(pieces)[:-1]])
    share: NDArray[np.float64] = (np.arange(len(index)) - first[index]) / pieces[index]
    return np.concatenate([begin[index] + share[:, None] * step[index], line[-1:]])


def _stop_area(stop: StopLine) -> FloatArray:
    """The corners ``(4, 3)`` of a stop line.

    One that follows from a signal runs from the left to the right where one has to stop, so the
    paint lies before it; that of an object is the middle of the paint.
    """
    ends = stop.line[[0, -1]]
    step = ends[1] - ends[0]
    size = float(np.sqrt(step[0] ** 2 + step[1] ** 2))
    if size == 0.0:
        return ends[:1]
    ahead = np.array([step[1], -step[0], 0.0]) / size * STOP_LINE_DEPTH_M
    far = ends if stop.source == "signal" else ends + ahead / 2.0
    return np.stack([far[0] - ahead, far[1] - ahead, far[1], far[0]])
