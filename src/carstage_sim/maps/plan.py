"""Street plans: what a built-in town is before it is geometry.

A plan names straight streets between grid points; everything else (junctions, turning lanes,
kerbs, lights, buildings) follows from it. Plans use OpenDRIVE's frame: x east, y north, metres.
"""

from __future__ import annotations

from dataclasses import dataclass

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class StreetProfile:
    """Cross-section of a street, equal on both sides of its centre line.

    Attributes:
        lanes: driving lanes per direction.
        speed_limit_kmh: posted limit.
        lane_width_m, gutter_width_m, sidewalk_width_m: widths from the inside outwards.
    """

    lanes: int
    speed_limit_kmh: int
    lane_width_m: float = 3.5
    gutter_width_m: float = 0.5
    sidewalk_width_m: float = 4.0

    @property
    def kerb_m(self) -> float:
        """Distance of the kerb from the centre line."""
        return self.lanes * self.lane_width_m + self.gutter_width_m


@dataclass(frozen=True, slots=True)
class Street:
    """A street along axis-parallel legs; inner points are rounded, end points are junctions."""

    points: tuple[Point, ...]
    profile: StreetProfile


@dataclass(frozen=True, slots=True)
class TownPlan:
    """A whole town.

    Attributes:
        name: short map name.
        latitude_deg, longitude_deg: of the origin.
        streets: every street; where two or more end in one point is a junction.
        bend_radius_m: radius of the centre line in a street's inner points.
        kerb_radius_m: radius of the kerb at junction corners.
    """

    name: str
    latitude_deg: float
    longitude_deg: float
    streets: tuple[Street, ...]
    bend_radius_m: float = 24.0
    kerb_radius_m: float = 8.0


def grid_plan(
    name: str,
    columns: tuple[float, ...],
    rows: tuple[float, ...],
    *,
    narrow: StreetProfile,
    wide: StreetProfile,
    wide_columns: frozenset[int],
    wide_rows: frozenset[int],
    geo_reference: Point,
) -> TownPlan:
    """A plan of a rectangular grid; its four corners are bends, all other crossings junctions.

    Args:
        name: short map name.
        columns, rows: ascending x of the columns and y of the rows.
        narrow, wide: profiles of ordinary streets and of the main ones.
        wide_columns, wide_rows: indices that get the wide profile; not the outermost ones, because
            a bend joins two of those and has one profile.
        geo_reference: latitude and longitude of the origin in degrees.
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
    return TownPlan(name, geo_reference[0], geo_reference[1], tuple(streets))


STAGE01 = grid_plan(
    "Stage01",
    columns=(-190.0, -65.0, 55.0, 190.0),
    rows=(-112.0, 0.0, 118.0),
    narrow=StreetProfile(lanes=1, speed_limit_kmh=30),
    wide=StreetProfile(lanes=2, speed_limit_kmh=50),
    wide_columns=frozenset({1}),
    wide_rows=frozenset({1}),
    geo_reference=(49.0, 8.4),
)

PLANS: dict[str, TownPlan] = {plan.name: plan for plan in (STAGE01,)}
