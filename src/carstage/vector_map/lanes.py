"""The lanes of roads and what is painted between them.

ASAM OpenDRIVE 1.6, section 9: lane sections, widths and borders (9.5), heights (9.6.5), road
markings (9.7). Finer structure of a marking (its ``<line>`` elements) is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from carstage.geometry import FloatArray
from carstage.vector_map.course import fine_stations
from carstage.vector_map.document import (
    FARTHEST_M,
    WIDEST_M,
    LaneRecord,
    Road,
    RoadMark,
    Section,
    refuse,
)
from carstage.vector_map.model import Lane, Marking, SpeedLimit

TOLERANCE_M = 0.01
"""How far a chord may be from the curve that it stands for."""
_DIGITS = 4
"""Of places and lengths: a tenth of a millimetre."""
_MOST_CHORDS = 20_000
"""Of one formula of one lane section."""
_COLOURS = {"standard": "white"} | {
    name: name for name in ("white", "yellow", "blue", "green", "red")
}
_MARKS = {
    "none", "solid", "broken", "solid solid", "solid broken", "broken solid", "broken broken",
    "botts dots", "grass", "curb",
}  # fmt: skip
_BOTH_WAYS = "bidirectional"


def lane_id(road: Road, section: int, lane: int) -> str:
    """``road/section/lane``."""
    return f"{road.number}/{section}/{lane}"


def is_forward(road: Road, lane: int) -> bool:
    """Whether one drives along the reference line: on its right where one drives on the right."""
    return (lane < 0) != road.left_hand


def carla_places(places: FloatArray) -> FloatArray:
    """Places of OpenDRIVE's right-handed frame in CARLA's, rounded to a tenth of a millimetre."""
    # Adding 0 makes -0 into 0.
    return np.asarray(np.round(places * (1.0, -1.0, 1.0), _DIGITS) + 0.0)


def road_lanes(road: Road) -> Iterator[tuple[list[Lane], list[Marking]]]:
    """Lanes without their links, and markings, section by section.

    Raises:
        VectorMapError: a lane is where no road can be.
    """
    for number, section in enumerate(road.sections):
        cut = _CutSection.of(road, number, section)
        yield cut.lanes(), [mark for one in section.lanes.values() for mark in cut.markings(one)]


@dataclass(frozen=True, slots=True, eq=False)
class _CutSection:
    """A lane section, cut at stations.

    Attributes:
        numbers: of its lanes, from the right to the left, the middle among them.
        stations: ``(N,)``.
        offsets: ``(M, N)`` of each lane's outer border from the reference line, to the left; of
            the middle its own.
        places: ``(M, N, 3)`` of the same, rounded, in CARLA's frame.
    """

    road: Road
    number: int
    section: Section
    numbers: list[int]
    stations: FloatArray
    offsets: FloatArray
    places: FloatArray

    @classmethod
    def of(cls, road: Road, number: int, section: Section) -> _CutSection:
        numbers = sorted({0, *section.lanes})
        edges = _edges(road, section)

        def places(s: FloatArray) -> FloatArray:
            return road.course.beside(s, _offsets(road, section, numbers, s))

        with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is refused below
            stations = fine_stations(places, edges, TOLERANCE_M, _MOST_CHORDS)
            # At its end, the formulas of the next section hold, which may lie elsewhere.
            before_end = np.minimum(stations, max(edges[0], edges[-1] - 1e-9))
            offsets = _offsets(road, section, numbers, before_end)
            found = road.course.beside(before_end, offsets)
        bad = ~(np.abs(found) <= FARTHEST_M).all(axis=(0, 2))
        if bad.any():
            refuse(
                f"road {road.number}, s={stations[np.argmax(bad)]:.1f} m",
                f"it is beyond {FARTHEST_M / 1e3:.0f} km",
            )
        wide = np.abs(np.diff(offsets, axis=0)).max(initial=0.0)
        if wide > WIDEST_M:
            refuse(f"road {road.number}", f"a lane is {wide:.0f} m wide (at most {WIDEST_M:.0f})")
        return cls(road, number, section, numbers, stations, offsets, carla_places(found))

    def lanes(self) -> list[Lane]:
        return [self._lane(record) for n, record in sorted(self.section.lanes.items()) if n]

    def _lane(self, record: LaneRecord) -> Lane:
        road, number = self.road, record.number
        outer, inner = self.numbers.index(number), self.numbers.index(self._inwards(number))
        inner_m, outer_m = self._heights(record)
        inner_line = _raised(self.places[inner], inner_m)
        outer_line = _raised(self.places[outer], outer_m)
        width = np.round(np.abs(self.offsets[outer] - self.offsets[inner]), _DIGITS)
        forward = is_forward(road, number)
        # Seen along the reference line, the left boundary of a lane on the left is the outer one.
        ways = {True: slice(None), False: slice(None, None, -1)}[forward]
        left, right = (outer_line, inner_line) if number > 0 else (inner_line, outer_line)
        left_marks, right_marks = (number, self._inwards(number))[:: 1 if number > 0 else -1]
        if not forward:
            left, right, left_marks, right_marks = right, left, right_marks, left_marks
        beside = {step: self._beside(number, step) for step in (-1, 1)}
        towards_left = 1 if forward else -1
        both = record.type == _BOTH_WAYS
        return Lane(
            id=lane_id(road, self.number, number),
            road_id=road.number,
            section=self.number,
            lane=number,
            junction_id=road.junction,
            type=record.type,
            direction="both" if both else "forward" if forward else "backward",
            centre_line=np.round((left + right) / 2, _DIGITS)[ways] + 0.0,
            left_boundary=left[ways],
            right_boundary=right[ways],
            s_m=np.round(self.stations, _DIGITS)[ways],
            width_m=width[ways],
            left_neighbour=beside[towards_left],
            right_neighbour=beside[-towards_left],
            left_markings=self._marking_ids(left_marks),
            right_markings=self._marking_ids(right_marks),
            speed_limits=self._limits(record),
        )

    def markings(self, record: LaneRecord) -> Iterator[Marking]:
        """What is painted on the outer boundary of a lane, or in the middle."""
        row = self.numbers.index(record.number)
        line = _raised(self.places[row], self._heights(record)[1])
        for count, mark, begin, end in self._pieces(record):
            name = lane_id(self.road, self.number, record.number)
            outwards = 1 if record.number >= 0 else -1
            beside = (self._at(record.number), self._beside(record.number, outwards))
            if record.number == 0:
                beside = (self._at(-1), self._at(1))
            yield Marking(
                id=f"{name}/{count}",
                road_id=self.road.number,
                section=self.number,
                lane=record.number,
                line=line[begin : end + 1],
                s_m=np.round(self.stations[[begin, end]], _DIGITS),
                type=mark.type if mark.type in _MARKS else "other",
                colour=_COLOURS.get(mark.colour, "other"),
                width_m=mark.width_m,
                lane_change=mark.lane_change,
                lanes=tuple(one for one in beside if one is not None),
            )

    def _pieces(self, record: LaneRecord) -> Iterator[tuple[int, RoadMark, int, int]]:
        begins = [self._index(self.section.begin_m + mark.s_m) for mark in record.marks]
        ends = [*begins[1:], *([len(self.stations) - 1] if begins else [])]
        for count, (mark, begin, end) in enumerate(zip(record.marks, begins, ends, strict=True)):
            if mark.type != "none" and end > begin:
                yield count, mark, begin, end

    def _index(self, s_m: float) -> int:
        """Of the station nearest to one that is among them, or of the last one."""
        return int(np.abs(self.stations - s_m).argmin())

    def _marking_ids(self, number: int) -> tuple[str, ...]:
        record = self.section.lanes.get(number)
        if record is None:
            return ()
        name = lane_id(self.road, self.number, number)
        return tuple(f"{name}/{count}" for count, *_ in self._pieces(record))

    def _inwards(self, number: int) -> int:
        row = self.numbers.index(number)
        return self.numbers[row - 1 if number > 0 else row + 1]

    def _at(self, number: int) -> str | None:
        found = number != 0 and number in self.section.lanes
        return lane_id(self.road, self.number, number) if found else None

    def _beside(self, number: int, step: int) -> str | None:
        """The lane to the left (1) or the right (-1) of one, over the middle too."""
        row = self.numbers.index(number) + step
        if 0 <= row < len(self.numbers) and self.numbers[row] == 0:
            row += step
        return self._at(self.numbers[row]) if 0 <= row < len(self.numbers) else None

    def _heights(self, record: LaneRecord) -> tuple[FloatArray, FloatArray]:
        """How high the inner and the outer border lie above the road, ``(N,)`` each."""
        table = np.array(record.heights or [(0.0, 0.0, 0.0)])
        index = np.searchsorted(table[:, 0], self.stations - self.section.begin_m, side="right")
        row = np.clip(index - 1, 0, None)
        return table[row, 1], table[row, 2]

    def _limits(self, record: LaneRecord) -> tuple[SpeedLimit, ...]:
        """Of the lane, else of the road."""
        begin, end = self.section.begin_m, self.section.end_m
        found = record.speeds or self.road.speeds
        first = [speed for speed in found if speed.s_m <= begin][-1:]
        later = [speed for speed in found if begin < speed.s_m < end]
        return tuple(
            SpeedLimit(
                round(max(begin, speed.s_m), _DIGITS),
                None if speed.limit_m_s is None else round(speed.limit_m_s, _DIGITS),
            )
            for speed in (*first, *later)
        )


def _edges(road: Road, section: Section) -> FloatArray:
    """Where a formula, a marking or a height of a section gives way to the next one."""
    offsets = [
        np.concatenate(
            [
                lane.width.start,
                [mark.s_m for mark in lane.marks],
                [height[0] for height in lane.heights],
            ]
        )
        for lane in section.lanes.values()
    ]
    begin, end = section.begin_m, section.end_m
    stations = np.concatenate([road.course.stations, *(begin + some for some in offsets)])
    inside = stations[(stations > begin) & (stations < end)]
    edges = np.unique(np.concatenate([[begin, end], inside]))
    # Exporters repeat a station with other digits; a chord of a micrometre has no direction.
    keep = np.concatenate([[True], np.diff(edges) > 1e-6])
    keep[-1] = True
    edges = edges[keep]
    return edges if len(edges) > 1 else np.repeat(edges, 2)


def _offsets(road: Road, section: Section, numbers: list[int], s: FloatArray) -> FloatArray:
    """``(M, N)`` of the outer borders from the reference line, to the left."""
    middle = road.course.offset.at(s)
    offsets = np.empty((len(numbers), len(s)))
    offsets[numbers.index(0)] = middle
    for side in (1, -1):
        border = middle
        for number in sorted((n for n in numbers if n * side > 0), key=abs):
            record = section.lanes[number]
            value = record.width.at(s - section.begin_m)
            # A border is signed and counts from the middle; a width is none below 0.
            border = middle + value if record.is_border else border + side * np.maximum(value, 0.0)
            offsets[numbers.index(number)] = border
    return offsets


def _raised(line: FloatArray, height_m: FloatArray) -> FloatArray:
    raised = line.copy()
    raised[:, 2] = np.round(raised[:, 2] + height_m, _DIGITS) + 0.0
    return raised
