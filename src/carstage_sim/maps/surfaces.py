"""The ground plan of a level: which piece of the plane is road, line, kerb, sidewalk or soil.

All shapes are shapely geometries in CARLA's x, y. They may overlap; the order in which
:func:`ground_layers` returns them decides which one wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.markings import lane_lines, painted_arrows, stop_lines, turn_arrows, zebra
from carstage_sim.maps.road_wear import UNWORN, RoadWear
from carstage_sim.maps.shrinking import shrunk
from carstage_sim.maps.signals import GovernedLane, PaintedArrow, SignalPlan
from carstage_sim.maps.strips import MEDIAN_KINDS, WALKED_KINDS, Strip
from carstage_sim.mesh import Material

KERB_HEIGHT_M = 0.15
_KERB_WIDTH_M = 0.15
RAMP_LENGTH_M = 1.2
_SEAM_M = 0.02
"""Strips of neighbouring roads meet within this; they are grown and shrunk by it to fuse."""
_GAP_M2 = 600.0
_GAP_HALF_WIDTH_M = 5.0
"""Holes in the road that are smaller than this and hold no circle of this radius are gaps between
turning lanes; wider ones are traffic islands."""
_ISLAND_M2 = 3000.0
_WIDEST_GUTTER_M = 1.2
"""Wider shoulders are paved like the lanes beside them."""
_SMALLEST_BLOCK_M2 = 600.0
_SMALLEST_PARK_M2 = 1500.0
_TERRAIN_MARGIN_M = 300.0
_YARD_WIDTH_M = 17.0
_PARK_WALK_M = 10.0
_APRON_M = 1.2
"""Paved ground around a house at a sidewalk: no grass grows between them."""


@dataclass(frozen=True, slots=True)
class Ramp:
    """A lowered kerb: rises from the road to the sidewalk's height along ``direction``.

    Attributes:
        area: the rectangle.
        foot: a point on its lower edge.
        direction: unit vector uphill.
    """

    area: BaseGeometry
    foot: tuple[float, float]
    direction: tuple[float, float]

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height in metres at ``(N, 2)`` points."""
        run = (points - np.array(self.foot)) @ np.array(self.direction)
        heights: NDArray[np.float64] = np.clip(run / RAMP_LENGTH_M, 0.0, 1.0) * KERB_HEIGHT_M
        return heights


@dataclass(frozen=True, slots=True)
class Surfaces:
    """The named areas of one level.

    Attributes:
        road: all that wheels may touch.
        gutter: its rims.
        sidewalk, median, islands: raised areas; islands are closed in by the road.
        blocks: land enclosed by sidewalks.
        parks: blocks that stay green.
        terrain: everything, out to the edge of the world; empty above the ground level.
    """

    road: BaseGeometry
    gutter: BaseGeometry
    sidewalk: BaseGeometry
    median: BaseGeometry
    islands: BaseGeometry
    crosswalks: tuple[shapely.Polygon, ...]
    ramps: tuple[Ramp, ...]
    blocks: tuple[shapely.Polygon, ...]
    parks: tuple[shapely.Polygon, ...]
    park_paths: tuple[BaseGeometry, ...]
    terrain: shapely.Polygon


@dataclass(frozen=True, slots=True)
class Layer:
    """One kind of ground: where, how high, what it looks like and what it is called.

    Attributes:
        height_m: above the lanes' height there.
        ramp: gives the height above the lanes in place of ``height_m``.
        is_land: lies between the roads at its own height, and meets them at their edges.
    """

    area: BaseGeometry
    material: Material
    tag: CityObjectLabel
    height_m: float = KERB_HEIGHT_M
    ramp: Ramp | None = None
    is_land: bool = False


def surfaces(
    lanes: list[Strip],
    crosswalks: list[shapely.Polygon],
    *,
    with_land: bool = True,
) -> Surfaces:
    """Fuses the lane strips of a level into areas.

    Args:
        lanes: the level's strips.
        crosswalks: outlines on this level.
        with_land: for the ground level.
    """
    raised = WALKED_KINDS | MEDIAN_KINDS
    carriage = _fused([lane for lane in lanes if lane.kind not in raised])
    road = _on_grid(_without_gaps(carriage))
    paved = _fused([lane for lane in lanes if lane.kind in WALKED_KINDS])
    median = _fused([lane for lane in lanes if lane.kind in MEDIAN_KINDS])
    sidewalk = _on_grid(paved.difference(road))
    median = _on_grid(median.difference(road.union(sidewalk)))
    rims = [x for x in lanes if x.kind == "shoulder" and x.width_m.max() <= _WIDEST_GUTTER_M]
    gutter = _fused(rims)
    lanes_only = _fused([lane for lane in lanes if lane.kind == "driving"])
    gutter = _on_grid(gutter.difference(lanes_only).intersection(road))
    none = shapely.Polygon()
    if not with_land:
        return Surfaces(
            road, gutter, sidewalk, median, none, tuple(crosswalks), (), (), (), (), none
        )
    grown = shapely.union_all([road, sidewalk, median]).buffer(_SEAM_M, join_style="mitre")
    both = _on_grid(shrunk(grown, _SEAM_M))
    holes = [shapely.Polygon(hole) for part in shapely.get_parts(both) for hole in part.interiors]
    beside_walks = sidewalk.buffer(_SEAM_M)
    shapely.prepare(beside_walks)
    islands, blocks = [], []
    for hole in holes:
        if shapely.intersects(beside_walks, hole.exterior):
            blocks += [hole] if hole.area >= _SMALLEST_BLOCK_M2 else []
        elif hole.area < _ISLAND_M2:
            islands.append(hole)
    # The smallest block is the park.
    wide = sorted(blocks, key=lambda block: float(block.area))
    parks = tuple([block for block in wide if block.area >= _SMALLEST_PARK_M2][:1])
    parks = parks if len(blocks) > 1 else ()
    x0, y0, x1, y1 = both.bounds
    m = _TERRAIN_MARGIN_M
    return Surfaces(
        road=road,
        gutter=gutter,
        sidewalk=sidewalk,
        median=median,
        islands=_on_grid(shapely.union_all(islands)),
        crosswalks=tuple(crosswalks),
        ramps=tuple(ramp for crosswalk in crosswalks for ramp in _ramps(crosswalk, sidewalk)),
        blocks=tuple(blocks),
        parks=parks,
        park_paths=tuple(_on_grid(_paths(park)) for park in parks),
        terrain=shapely.box(x0 - m, y0 - m, x1 + m, y1 + m),
    )


def ground_layers(
    ground: Surfaces,
    lanes: list[Strip],
    plan: SignalPlan,
    stops: Sequence[GovernedLane],
    arrows: Sequence[PaintedArrow],
    pits: list[shapely.Polygon],
    buildings: list[shapely.Polygon],
    wear: RoadWear = UNWORN,
) -> list[Layer]:
    """All kinds of ground, the ones that win first; together they cover the terrain.

    Args:
        ground: the areas.
        lanes: strips, for the lane lines.
        plan: for the turns that arrows show where the file has no arrows.
        stops: lanes with a light or a stop sign on this level.
        arrows: those of the file on this level.
        pits: squares of open soil around trees.
        buildings: footprints; the blocks that they stand in have paved rims.
        wear: of the level's roads.
    """
    label = CityObjectLabel
    white, yellow = lane_lines(lanes, ground.crosswalks)
    bars = zebra(ground.crosswalks, lanes)
    raised = shapely.union_all([ground.sidewalk, ground.median, ground.islands])
    kerb = ground.road.buffer(_KERB_WIDTH_M, join_style="mitre")
    near_raised = raised.buffer(_SEAM_M).difference(ground.road)
    line, road_lines = Material.LANE_MARKING_WHITE, label.ROAD_LINES
    turning = painted_arrows(arrows) if plan.arrows else turn_arrows(lanes, plan)
    layers = [
        Layer(bars, Material.CROSSWALK_WHITE, road_lines, 0.0),
        Layer(turning, line, road_lines, 0.0),
        Layer(stop_lines(stops), line, road_lines, 0.0),
        Layer(white, line, road_lines, 0.0),
        Layer(yellow, Material.LANE_MARKING_YELLOW, road_lines, 0.0),
    ]
    layers = [
        Layer(layer.area.intersection(ground.road), layer.material, layer.tag, 0.0)
        for layer in layers
    ]
    return [
        *layers,
        *(
            Layer(_on_grid(area.intersection(ground.road)), material, label.ROADS, 0.0)
            for area, material in (
                (wear.covers, Material.COVER),
                (wear.repairs, Material.ASPHALT_NEW),
                (wear.tar.difference(ground.gutter), Material.TAR),
            )
        ),
        Layer(ground.gutter, Material.GUTTER, label.ROADS, 0.0),
        Layer(ground.road, Material.ASPHALT, label.ROADS, 0.0),
        *(Layer(r.area, Material.TACTILE, label.SIDEWALKS, ramp=r) for r in ground.ramps),
        Layer(kerb.intersection(near_raised), Material.KERB, label.SIDEWALKS),
        Layer(shapely.union_all(pits), Material.SOIL, label.TERRAIN),
        Layer(ground.sidewalk, Material.SIDEWALK, label.SIDEWALKS),
        Layer(ground.median, Material.GRASS, label.TERRAIN),
        Layer(ground.islands, Material.GRASS, label.TERRAIN),
        Layer(shapely.union_all(ground.park_paths), Material.SIDEWALK, label.GROUND, is_land=True),
        Layer(_on_grid(_yards(ground, buildings)), Material.CONCRETE, label.GROUND, is_land=True),
        Layer(ground.terrain, Material.GRASS, label.TERRAIN, is_land=True),
    ]


def _yards(ground: Surfaces, buildings: list[shapely.Polygon]) -> BaseGeometry:
    """The paved rim of built-up blocks behind their sidewalks, and aprons of houses beside them."""
    tree = shapely.STRtree(buildings)
    built = [
        block
        for block in ground.blocks
        if block not in ground.parks and len(tree.query(block, predicate="intersects"))
    ]
    inner = [block.buffer(-_YARD_WIDTH_M, join_style="mitre") for block in built]
    rim = shapely.union_all(built).difference(shapely.union_all(inner))
    # A block may border on country roads, too, where nobody builds.
    # The limit keeps the pointed end of a sidewalk from reaching far along such a road.
    near = ground.sidewalk.buffer(_YARD_WIDTH_M + 1.0, join_style="mitre", mitre_limit=1.5)
    beside = shapely.STRtree(shapely.get_parts(ground.sidewalk))
    aprons = [
        house.buffer(_APRON_M, join_style="mitre")
        for house in buildings
        if len(beside.query(house, predicate="dwithin", distance=_APRON_M))
    ]
    return shapely.union_all([rim.intersection(near), *aprons])


def _paths(park: shapely.Polygon) -> BaseGeometry:
    """A round walk with four spokes, and entrances from the sidewalks."""
    x0, y0, x1, y1 = park.bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    lines = [
        park.buffer(-_PARK_WALK_M).exterior,
        shapely.Point(x, y).buffer(7.0).exterior,
        shapely.LineString([(x0, y), (x - 7.0, y)]),
        shapely.LineString([(x + 7.0, y), (x1, y)]),
        shapely.LineString([(x, y0), (x, y - 7.0)]),
        shapely.LineString([(x, y + 7.0), (x, y1)]),
    ]
    return shapely.union_all([line.buffer(1.25) for line in lines]).intersection(park)


def _fused(lanes: list[Strip]) -> BaseGeometry:
    grown = [lane.polygon.buffer(_SEAM_M, join_style="mitre") for lane in lanes]
    return shrunk(shapely.union_all(grown), _SEAM_M)


def _without_gaps(road: BaseGeometry) -> BaseGeometry:
    """The road with the gaps between turning lanes closed."""
    return shapely.union_all(
        [
            shapely.Polygon(part.exterior, [hole for hole in part.interiors if not _is_gap(hole)])
            for part in shapely.get_parts(road)
            if part.geom_type == "Polygon"
        ]
    )


def _is_gap(ring: shapely.LinearRing) -> bool:
    hole = shapely.Polygon(ring)
    return bool(hole.area < _GAP_M2 and hole.buffer(-_GAP_HALF_WIDTH_M).is_empty)


def _on_grid(geometry: BaseGeometry) -> BaseGeometry:
    """Without superfluous vertices, on a grid of millimetres."""
    return shapely.set_precision(geometry.simplify(0.002), 0.001)


def _ramps(crosswalk: shapely.Polygon, sidewalk: BaseGeometry) -> list[Ramp]:
    """A ramp at each edge of the crosswalk that borders on a sidewalk."""
    corners = np.array(crosswalk.exterior.coords)[:-1]
    middle = corners.mean(axis=0)
    result = []
    for i, a in enumerate(corners):
        b = corners[(i + 1) % len(corners)]
        if np.linalg.norm(b - a) < 2 * _SEAM_M:
            continue
        along = (b - a) / np.linalg.norm(b - a)
        uphill = np.array([along[1], -along[0]])
        if uphill @ ((a + b) / 2 - middle) < 0:
            uphill = -uphill
        rise = uphill * RAMP_LENGTH_M
        area = shapely.Polygon(np.stack([a, b, b + rise, a + rise]))
        if area.intersection(sidewalk).area > 0.95 * area.area:
            foot, direction = (float(a[0]), float(a[1])), (float(uphill[0]), float(uphill[1]))
            result.append(Ramp(_on_grid(area), foot, direction))
    return result
