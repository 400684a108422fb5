"""Plans: what a built-in town is before it is geometry.

A plan names the centre lines of streets and the points where they end; everything else (junctions,
turning lanes, kerbs, lights, heights) follows from it. Plans use OpenDRIVE's frame: x east, y
north, metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from carstage_sim.maps.writer.alignment import Point


@dataclass(frozen=True, slots=True)
class StreetProfile:
    """Cross-section of a street, equal on both sides of its centre line.

    Attributes:
        lanes: driving lanes per direction.
        speed_limit_kmh: posted limit.
        lane_width_m, biking_width_m, gutter_width_m, sidewalk_width_m: widths from the inside
            outwards; 0 leaves a bicycle lane or a sidewalk out.
        parking_width_m: width of parking bays, cut out of the sidewalks away from junctions.
        kind: OpenDRIVE's road type.
    """

    lanes: int
    speed_limit_kmh: int
    lane_width_m: float = 3.5
    gutter_width_m: float = 0.5
    sidewalk_width_m: float = 4.0
    biking_width_m: float = 0.0
    parking_width_m: float = 0.0
    kind: str = "town"


@dataclass(frozen=True, slots=True)
class Street:
    """A street along straight legs; inner points are rounded, end points are crossings.

    Attributes:
        points: at least two; the first and last are shared with other streets.
        profile: cross-section.
        bend_radius_m: radius of the centre line in the inner points.
    """

    points: tuple[Point, ...]
    profile: StreetProfile
    bend_radius_m: float = 24.0


class Control(Enum):
    """Who waits at a crossing."""

    SIGNALS = "signals"
    STOP = "stop"
    """Traffic from the arm without an opposite, or from the narrower street, stops."""
    YIELD = "yield"
    """The same traffic gives way."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """What is special about a point where streets end.

    Attributes:
        center: the point.
        control: who waits.
        height_m: above the ground of the plan.
        kerb_radius_m: of its corners; by default the plan's.
    """

    center: Point
    control: Control = Control.SIGNALS
    height_m: float = 0.0
    kerb_radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class Roundabout:
    """A circle of one lane where streets end.

    Attributes:
        center: of the circle and of the streets' centre lines.
        island_radius_m: edge of the central island.
        lane_width_m: of the circle.
        half_opening_deg: angle, seen from the centre, between an arm and the place where its
            traffic has joined the circle.
        mouth_m: distance from the centre at which the arms end.
    """

    center: Point
    island_radius_m: float = 18.0
    lane_width_m: float = 5.0
    half_opening_deg: float = 30.0
    mouth_m: float = 37.0


@dataclass(frozen=True, slots=True)
class Hill:
    """A bell-shaped hill (or hollow, where the height is negative)."""

    top: Point
    height_m: float
    radius_m: float

    def height_at(self, point: Point) -> float:
        """Height above the plain in metres."""
        away = math.dist(point, self.top) / self.radius_m
        return self.height_m * math.exp(-away * away)


@dataclass(frozen=True, slots=True)
class Interchange:
    """A diamond: a street bridges a motorway, and a ramp joins it from and to each direction.

    The street's crossings with the ramps are two points of the plan, ``terminal_m`` to either side
    of the motorway's middle.

    Attributes:
        station_m: along the motorway's middle.
        ramp_reach_m: how far along the motorway the ramps leave and join it.
        terminal_m: distance of the two crossings from the motorway's middle.
        ramp_limit_kmh: posted on the ramps.
    """

    station_m: float
    ramp_reach_m: float = 245.0
    terminal_m: float = 75.0
    ramp_limit_kmh: int = 50


@dataclass(frozen=True, slots=True)
class Motorway:
    """A ring of two carriageways around the origin: a rectangle with round corners.

    Attributes:
        size_m: width and height of the rectangle, between the middles of the motorway.
        corner_radius_m: of the middle.
        interchanges: ascending stations; stations count counter-clockwise from the western end of
            the southern straight.
        lanes: per carriageway.
        speed_limit_kmh: posted limit.
        lane_width_m, inner_shoulder_m, hard_shoulder_m: widths of each carriageway.
        median_m: half the width of the strip between the carriageways.
    """

    size_m: tuple[float, float]
    corner_radius_m: float
    interchanges: tuple[Interchange, ...]
    lanes: int = 3
    speed_limit_kmh: int = 100
    lane_width_m: float = 3.6
    inner_shoulder_m: float = 1.0
    hard_shoulder_m: float = 2.6
    median_m: float = 2.0


@dataclass(frozen=True, slots=True)
class TownPlan:
    """A whole town.

    Attributes:
        name: short map name.
        latitude_deg, longitude_deg: of the origin.
        streets: every street; where two or more end in one point they cross.
        crossings: those that are special; all others are level with the ground and have lights.
        roundabouts: crossings that are circles.
        hills: what the ground is made of; none make a plain.
        motorways: around or beside the streets.
        kerb_radius_m: radius of the kerb at the corners of crossings.
        turn_limit_kmh: limit on paths that turn at a crossing, where the streets' own limits are
            too fast for it: the client's Traffic Manager speeds up within a turn and then swings
            into the opposite lane. None leaves those of the streets.
    """

    name: str
    latitude_deg: float
    longitude_deg: float
    streets: tuple[Street, ...]
    crossings: tuple[Crossing, ...] = ()
    roundabouts: tuple[Roundabout, ...] = ()
    hills: tuple[Hill, ...] = ()
    motorways: tuple[Motorway, ...] = ()
    kerb_radius_m: float = 8.0
    turn_limit_kmh: int | None = None

    def ground_m(self, point: Point) -> float:
        """Height of the ground."""
        return sum((hill.height_at(point) for hill in self.hills), start=0.0)


def grid_streets(
    columns: tuple[float, ...],
    rows: tuple[float, ...],
    *,
    narrow: StreetProfile,
    wide: StreetProfile,
    wide_columns: frozenset[int],
    wide_rows: frozenset[int],
) -> tuple[Street, ...]:
    """The streets of a rectangular grid; its corners are bends, all other crossings junctions.

    Args:
        columns, rows: ascending x of the columns and y of the rows.
        narrow, wide: profiles of ordinary streets and of the main ones.
        wide_columns, wide_rows: indices that get the wide profile; not the outermost ones, because
            a bend joins two of those and has one profile.
    """
    last_column, last_row = len(columns) - 1, len(rows) - 1

    def is_corner(column: int, row: int) -> bool:
        return column in (0, last_column) and row in (0, last_row)

    streets: list[Street] = []
    for r, y in enumerate(rows):
        profile = wide if r in wide_rows else narrow
        for c in range(last_column):
            if not (is_corner(c, r) or is_corner(c + 1, r)):
                streets.append(Street(((columns[c], y), (columns[c + 1], y)), profile))
    for c, x in enumerate(columns):
        profile = wide if c in wide_columns else narrow
        for r in range(last_row):
            if not (is_corner(c, r) or is_corner(c, r + 1)):
                streets.append(Street(((x, rows[r]), (x, rows[r + 1])), profile))
    for c, inner_c in ((0, 1), (last_column, last_column - 1)):
        for r, inner_r in ((0, 1), (last_row, last_row - 1)):
            legs = ((columns[inner_c], rows[r]), (columns[c], rows[r]), (columns[c], rows[inner_r]))
            streets.append(Street(legs, narrow))
    return tuple(streets)
