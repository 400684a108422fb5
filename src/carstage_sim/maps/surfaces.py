"""The ground plan of a town: which piece of the plane is road, line, kerb, sidewalk or soil.

All shapes are shapely geometries in CARLA's x, y. They may overlap; the order in which
:func:`ground_layers` returns them decides which one wins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.markings import lane_lines, stop_lines, turn_arrows, zebra
from carstage_sim.maps.network import RoadNetwork
from carstage_sim.maps.strips import Strip
from carstage_sim.mesh import Material

KERB_HEIGHT_M = 0.15
_KERB_WIDTH_M = 0.15
RAMP_LENGTH_M = 1.2
_SEAM_M = 0.02
"""Strips of neighbouring roads meet within this; they are grown and shrunk by it to fuse."""
_JUNCTION_HOLE_M2 = 600.0
"""Smaller holes in the road surface are gaps between turning lanes, larger ones are blocks."""
_TERRAIN_MARGIN_M = 300.0
_YARD_WIDTH_M = 17.0
_PARK_WALK_M = 10.0


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
    """The named areas of a town's ground."""

    road: BaseGeometry
    gutter: BaseGeometry
    sidewalk: BaseGeometry
    crosswalks: tuple[shapely.Polygon, ...]
    ramps: tuple[Ramp, ...]
    blocks: tuple[shapely.Polygon, ...]
    """Land enclosed by sidewalks."""
    parks: tuple[shapely.Polygon, ...]
    """Blocks that stay green."""
    park_paths: tuple[BaseGeometry, ...]
    terrain: shapely.Polygon
    """Everything, out to the edge of the world."""


@dataclass(frozen=True, slots=True)
class Layer:
    """One kind of ground: where, how high, what it looks like and what it is called."""

    area: BaseGeometry
    material: Material
    tag: CityObjectLabel
    height_m: float = KERB_HEIGHT_M
    ramp: Ramp | None = None


def surfaces(lanes: list[Strip], crosswalks: list[shapely.Polygon]) -> Surfaces:
    """Fuses lane strips into areas."""
    carriage = _fused([lane for lane in lanes if lane.kind not in ("sidewalk", "median")])
    road = shapely.union_all(
        [
            shapely.Polygon(
                part.exterior,
                [hole for hole in part.interiors if _area(hole) >= _JUNCTION_HOLE_M2],
            )
            for part in shapely.get_parts(carriage)
        ]
    )
    road = _on_grid(road)
    paved = _fused([lane for lane in lanes if lane.kind == "sidewalk"])
    sidewalk = _on_grid(paved.difference(road))
    gutter = _fused([lane for lane in lanes if lane.kind == "shoulder"])
    lanes_only = _fused([lane for lane in lanes if lane.kind == "driving"])
    gutter = _on_grid(gutter.difference(lanes_only).intersection(road))
    grown = road.union(sidewalk).buffer(_SEAM_M, join_style="mitre")
    both = _on_grid(grown.buffer(-_SEAM_M, join_style="mitre"))
    blocks = tuple(
        shapely.Polygon(hole)
        for part in shapely.get_parts(both)
        for hole in part.interiors
        if _area(hole) >= _JUNCTION_HOLE_M2
    )
    # The smallest block is the park.
    parks = (
        tuple(sorted(blocks, key=lambda block: float(block.area))[:1]) if len(blocks) > 1 else ()
    )
    x0, y0, x1, y1 = both.bounds
    m = _TERRAIN_MARGIN_M
    return Surfaces(
        road=road,
        gutter=gutter,
        sidewalk=sidewalk,
        crosswalks=tuple(crosswalks),
        ramps=tuple(ramp for crosswalk in crosswalks for ramp in _ramps(crosswalk, sidewalk)),
        blocks=blocks,
        parks=parks,
        park_paths=tuple(_on_grid(_paths(park)) for park in parks),
        terrain=shapely.box(x0 - m, y0 - m, x1 + m, y1 + m),
    )


def ground_layers(
    ground: Surfaces, lanes: list[Strip], network: RoadNetwork, pits: list[shapely.Polygon]
) -> list[Layer]:
    """All kinds of ground, the ones that win first; together they cover the terrain.

    Args:
        ground: the areas.
        lanes: strips, for the lane lines.
        network: for the stop lines.
        pits: squares of open soil around trees.
    """
    label = CityObjectLabel
    white, yellow = lane_lines(lanes, ground.crosswalks)
    stops = stop_lines(network)
    bars = zebra(ground.crosswalks, lanes)
    kerb = ground.road.buffer(_KERB_WIDTH_M, join_style="mitre")
    near_sidewalk = ground.sidewalk.buffer(_SEAM_M)
    return [
        Layer(bars, Material.CROSSWALK_WHITE, label.ROAD_LINES, 0.0),
        Layer(turn_arrows(network), Material.LANE_MARKING_WHITE, label.ROAD_LINES, 0.0),
        Layer(stops, Material.LANE_MARKING_WHITE, label.ROAD_LINES, 0.0),
        Layer(white, Material.LANE_MARKING_WHITE, label.ROAD_LINES, 0.0),
        Layer(yellow, Material.LANE_MARKING_YELLOW, label.ROAD_LINES, 0.0),
        Layer(ground.gutter, Material.CONCRETE, label.ROADS, 0.0),
        Layer(ground.road, Material.ASPHALT, label.ROADS, 0.0),
        *(Layer(r.area, Material.CONCRETE, label.SIDEWALKS, ramp=r) for r in ground.ramps),
        Layer(kerb.intersection(near_sidewalk), Material.KERB, label.SIDEWALKS),
        Layer(shapely.union_all(pits), Material.SOIL, label.TERRAIN),
        Layer(ground.sidewalk, Material.SIDEWALK, label.SIDEWALKS),
        Layer(shapely.union_all(ground.park_paths), Material.SIDEWALK, label.GROUND),
        Layer(_on_grid(_yards(ground)), Material.CONCRETE, label.GROUND),
        Layer(ground.terrain, Material.GRASS, label.TERRAIN),
    ]


def _yards(ground: Surfaces) -> BaseGeometry:
    """The paved rim of built-up blocks, on which the houses stand."""
    built = [block for block in ground.blocks if block not in ground.parks]
    inner = [block.buffer(-_YARD_WIDTH_M, join_style="mitre") for block in built]
    return shapely.union_all(built).difference(shapely.union_all(inner))


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
    return shapely.union_all(grown).buffer(-_SEAM_M, join_style="mitre")


def _on_grid(geometry: BaseGeometry) -> BaseGeometry:
    """Without superfluous vertices, on a grid of millimetres."""
    return shapely.set_precision(geometry.simplify(0.002), 0.001)


def _area(ring: shapely.LinearRing) -> float:
    return float(shapely.Polygon(ring).area)


def _ramps(crosswalk: shapely.Polygon, sidewalk: BaseGeometry) -> list[Ramp]:
    """A ramp at each edge of the crosswalk that borders on a sidewalk."""
    corners = np.array(crosswalk.exterior.coords)[:-1]
    middle = corners.mean(axis=0)
    result = []
    for i, a in enumerate(corners):
        b = corners[(i + 1) % len(corners)]
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
