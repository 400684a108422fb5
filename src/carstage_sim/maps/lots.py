"""Where buildings go: rows along the sidewalks, and a loose second row for the skyline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import affinity

from carstage_sim.content.buildings import BUILDING_KINDS, BuildingKind
from carstage_sim.maps.frontage import Frontage
from carstage_sim.maps.surfaces import Surfaces

_SETBACK_M = 0.6
_CORNER_REACH_M = 4.0
"""The first and last building of a row may reach this far beyond its street's ends."""
_WIDTHS_M = (24.0, 20.0, 16.0, 12.0)
_DEPTH_M = (11.0, 14.0)
_SKYLINE_M = (45.0, 130.0)
_SKYLINE_BUILDINGS = 16
_TOWN_LOTS = 40
_TOWN_EDGE_M = 40.0
_FROM_LANES_M = 1.5
_JOINT_M = 0.02
"""Between houses that stand wall to wall: their plinths are a little wider."""


@dataclass(frozen=True, slots=True)
class Lot:
    """A building to be.

    Attributes:
        x, y, yaw_deg: middle of the front's foot and where the front looks.
        width_m, depth_m, floors: size.
        detached: nobody's wall stands against it.
        distant: part of the skyline.
    """

    kind: BuildingKind
    x: float
    y: float
    yaw_deg: float
    width_m: float
    depth_m: float
    floors: int
    detached: bool
    distant: bool = False

    @property
    def footprint(self) -> shapely.Polygon:
        """The ground that it covers."""
        return _footprint(self.x, self.y, self.yaw_deg, self.width_m, self.depth_m)


def street_lots(
    streets: list[Frontage],
    ground: Surfaces,
    kept_free: list[shapely.Polygon],
    rng: np.random.Generator,
) -> list[Lot]:
    """Rows of buildings behind the sidewalks; greedy, first come first served."""
    taken = _Taken(
        [ground.road.buffer(_FROM_LANES_M), ground.median, ground.sidewalk.buffer(0.1), *kept_free]
    )
    lots: list[Lot] = []
    for street in streets:
        station = -_CORNER_REACH_M
        attached = False
        while station < street.length_m + _CORNER_REACH_M - _WIDTHS_M[-1]:
            lot = _lot_at(street, station, taken, rng, attached=attached)
            if lot is None:
                station, attached = station + 2.0, False
                continue
            taken.add(lot.footprint)
            lots.append(lot)
            attached = bool(rng.random() < 0.45)
            station += lot.width_m + (_JOINT_M if attached else float(rng.uniform(2.5, 5.0)))
    return lots


def skyline_lots(
    ground: Surfaces,
    lots: list[Lot],
    kept_free: Sequence[shapely.Geometry],
    rng: np.random.Generator,
) -> list[Lot]:
    """Tall buildings some way outside a town's last street; none where there is no town."""
    if len(lots) < _TOWN_LOTS:
        return []
    built_up = shapely.union_all([lot.footprint for lot in lots]).convex_hull.buffer(_TOWN_EDGE_M)
    hull = ground.road.intersection(built_up).convex_hull
    paved = shapely.union_all([ground.road, ground.sidewalk, *kept_free])
    taken = _Taken([hull.buffer(30.0), paved.buffer(30.0)])
    for lot in lots:
        taken.add(lot.footprint)
    result: list[Lot] = []
    for number in range(_SKYLINE_BUILDINGS):
        ring = hull.buffer(float(rng.uniform(*_SKYLINE_M))).exterior
        part = (number + float(rng.uniform(0.1, 0.9))) / _SKYLINE_BUILDINGS
        place = ring.interpolate(part, normalized=True)
        towards = hull.centroid
        # Square to the grid, front to the town.
        yaw = round(math.degrees(math.atan2(towards.y - place.y, towards.x - place.x)) / 90) * 90.0
        tall = [kind for kind in BUILDING_KINDS if kind.floors[1] >= 7]
        kind = tall[int(rng.integers(len(tall)))]
        width, depth = float(rng.uniform(22, 34)), float(rng.uniform(14, 20))
        floors = kind.floors[1] + int(rng.integers(0, 4))
        lot = Lot(
            kind,
            round(place.x, 2),
            round(place.y, 2),
            yaw,
            width_m=float(round(width)),
            depth_m=float(round(depth)),
            floors=floors,
            detached=True,
            distant=True,
        )
        if taken.is_free(lot.footprint.buffer(4.0)):
            taken.add(lot.footprint)
            result.append(lot)
    return result


class _Taken:
    """Ground that is built on already."""

    def __init__(self, areas: list[shapely.Geometry]) -> None:
        self._fixed = areas
        for area in areas:
            shapely.prepare(area)
        self._footprints: list[shapely.Polygon] = []

    def add(self, footprint: shapely.Polygon) -> None:
        self._footprints.append(footprint.buffer(_JOINT_M / 2, join_style="mitre"))

    def is_free(self, footprint: shapely.Polygon) -> bool:
        if any(shapely.intersects(area, footprint) for area in self._fixed):
            return False
        return not shapely.intersects(footprint, np.array(self._footprints)).any()


def _lot_at(
    street: Frontage,
    station_m: float,
    taken: _Taken,
    rng: np.random.Generator,
    *,
    attached: bool,
) -> Lot | None:
    kind = BUILDING_KINDS[int(rng.integers(len(BUILDING_KINDS) - 1))]
    if rng.random() < 0.06:
        kind = BUILDING_KINDS[-1]
    depth = float(round(rng.uniform(*_DEPTH_M), 1))
    floors = int(rng.integers(kind.floors[0], kind.floors[1] + 1))
    first = int(rng.integers(len(_WIDTHS_M) - 1))
    for width in _WIDTHS_M[first:]:
        x, y, yaw = street.from_back(station_m + width / 2, _SETBACK_M)
        x, y = round(x, 3), round(y, 3)
        if taken.is_free(_footprint(x, y, yaw, width, depth)):
            return Lot(kind, x, y, yaw, width, depth, floors, not attached)
    return None


def _footprint(
    x: float, y: float, yaw_deg: float, width_m: float, depth_m: float
) -> shapely.Polygon:
    here = shapely.box(-depth_m, -width_m / 2, 0.0, width_m / 2)
    return affinity.translate(affinity.rotate(here, yaw_deg, origin=(0, 0)), x, y)
