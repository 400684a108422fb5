"""Trees, bushes and hedges: in gardens, parks and the country around a town."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from carstage_sim.content.shrubs import bush_mesh, far_tree_mesh, hedge_mesh, tuft_mesh
from carstage_sim.content.street_furniture import bench_mesh
from carstage_sim.content.trees import TREE_KINDS, Form, TreeKind, street_form, tree_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.maps.lots import Lot
from carstage_sim.maps.placement import SceneryPlacement
from carstage_sim.maps.surfaces import Surfaces
from carstage_sim.mesh import Material, TriangleMesh

_LEAST_STREET_TREE_M = 8.0
"""Lower species are for gardens: their crowns would be in the way."""
STREET_TREES = [
    street_form(kind)
    for kind in TREE_KINDS
    if kind.form in (Form.ROUND, Form.COLUMN) and kind.height_m[1] > _LEAST_STREET_TREE_M
]
_TURNED = (0.0, 0.0, 0.06, 0.35)
"""Shares of trees in autumn colours: summer, the first yellow leaves, October."""
_GARDEN_TREES = 32
_PARK_TREES = 25
_PARK_BUSHES = 30
_GARDEN_REACH_M = 90.0
_M2_PER_TREE = 7000.0
_MOST_TREES = 300
_APART_M = 6.0
_WOOD_APART_M = 4.5
_FROM_OTHERS_M = 1.6
"""Between the middles of a bush and of a tree or a bench."""
_M2_PER_WOOD = 16_000.0
_WOODS = (14, 44)
"""Fewest and most groups of trees in the country around a town."""
_WOOD_TREES = (5, 16)
_WOOD_RADIUS_M = 16.0
_FROM_ROADS_M = 42.0
_FROM_HOUSES_M = 14.0
_TUFT_STEP_M = 0.9
_TUFT_REACH_M = 4.0
_TUFT_CLEAR_M = 0.3
_MOST_TUFTS = 14_000
"""Before those on other ground are left out."""
_HEDGE_M = 3.0
_HEDGE_HEIGHT_M = 1.05
_HEDGE_WIDTH_M = 0.7
_HEDGE_INSET_M = 1.2
_BUSHES = (
    Material.LEAVES_SMALL,
    Material.LEAVES_DARK,
    Material.LEAVES_SMALL,
    Material.LEAVES_LIGHT,
)


def share_turned(rng: np.random.Generator) -> float:
    """Share of a town's trees whose leaves have turned."""
    return _TURNED[int(rng.integers(len(_TURNED)))]


def plant(
    placement: SceneryPlacement,
    kind: TreeKind,
    place: tuple[float, float, float],
    rng: np.random.Generator,
    *,
    autumn: bool = False,
) -> None:
    """Put a tree of a species at x, y."""
    placement.no_bushes.append(place[:2])
    height = float(rng.uniform(*kind.height_m))
    x, y, _ = place
    turn = round(float(rng.uniform(-180.0, 180.0)), 1)
    # Its leaves are drawn apart, so that a change of them moves no other thing.
    (own,) = rng.spawn(1)
    mesh = tree_mesh(kind, height, own, autumn=autumn)
    placement.put(f"Tree_{kind.name}", CityObjectLabel.VEGETATION, mesh, (x, y, turn))


def _plant_bush(
    placement: SceneryPlacement, place: tuple[float, float], rng: np.random.Generator
) -> None:
    radius = float(rng.uniform(0.5, 1.1))
    leaves = _BUSHES[int(rng.integers(len(_BUSHES)))]
    turn = round(float(rng.uniform(-180.0, 180.0)), 1)
    (own,) = rng.spawn(1)
    if any(math.dist(place, other) < _FROM_OTHERS_M for other in placement.no_bushes):
        return
    mesh = bush_mesh(radius, own, leaves)
    placement.put("Bush", CityObjectLabel.VEGETATION, mesh, (*place, turn))


def plant_gardens(
    placement: SceneryPlacement,
    ground: Surfaces,
    lots: list[Lot],
    kept_free: Sequence[BaseGeometry],
    turned: float,
    rng: np.random.Generator,
) -> None:
    """Trees and bushes behind the houses and around the town.

    Args:
        placement: where they are put.
        ground: of the ground level.
        lots: of the houses.
        kept_free: areas below bridges.
        turned: share of the trees whose leaves have turned.
        rng: draws what and where.
    """
    paved = _paved(ground, kept_free)
    taken = _taken(paved, ground, lots, from_paved_m=4.0, from_houses_m=3.5)
    area = ground.road.convex_hull.buffer(_GARDEN_REACH_M)
    count = min(max(_GARDEN_TREES, round(area.area / _M2_PER_TREE)), _MOST_TREES)
    _plant_trees(placement, _scattered(area, taken, count, rng), turned, rng)
    near = paved.buffer(25.0).difference(taken)
    if not near.is_empty:
        for place in _scattered(near, taken, count, rng, apart_m=2.0):
            _plant_bush(placement, place, rng)


def plant_parks(
    placement: SceneryPlacement, ground: Surfaces, turned: float, rng: np.random.Generator
) -> None:
    """Trees, bushes and benches in the parks, and hedges around them; see :func:`plant_gardens`."""
    for park in ground.parks:
        benches = list(_benches(park))
        placement.no_bushes += [(x, y) for x, y, _ in benches]
        paths = shapely.union_all([path.buffer(1.5) for path in ground.park_paths])
        _plant_trees(placement, _scattered(park.buffer(-3.0), paths, _PARK_TREES, rng), turned, rng)
        for spot in _scattered(park.buffer(-3.0), paths, _PARK_BUSHES, rng, apart_m=3.0):
            _plant_bush(placement, spot, rng)
        _plant_hedges(placement, park, paths, rng)
        for place in benches:
            placement.put("Bench", CityObjectLabel.STATIC, bench_mesh(), place)


def _benches(park: shapely.Polygon) -> Iterator[tuple[float, float, float]]:
    """x, y (m) and yaw (deg) of benches around a park."""
    ring = park.buffer(-7.6).exterior
    for part in np.linspace(0.05, 0.95, 12):
        at = ring.interpolate(part, normalized=True)
        ahead = ring.interpolate(part + 0.005, normalized=True)
        yaw = math.degrees(math.atan2(ahead.y - at.y, ahead.x - at.x)) + 90.0
        yield at.x, at.y, round(yaw, 1)


def _plant_hedges(
    placement: SceneryPlacement,
    park: shapely.Polygon,
    paths: BaseGeometry,
    rng: np.random.Generator,
) -> None:
    """Pieces of hedge along a park's rim, open where its paths begin."""
    shapely.prepare(paths)
    rim = np.array(park.buffer(-_HEDGE_INSET_M).exterior.coords)
    planted: list[shapely.Polygon] = []
    pieces = [hedge_mesh(_HEDGE_M, _HEDGE_HEIGHT_M, _HEDGE_WIDTH_M, own) for own in rng.spawn(4)]
    for (x0, y0), (x1, y1) in itertools.pairwise(rim.tolist()):
        length = math.hypot(x1 - x0, y1 - y0)
        count = int(length / _HEDGE_M)
        yaw = round(math.degrees(math.atan2(y1 - y0, x1 - x0)) - 90.0, 1)
        for k in range(count):
            part = (k + 0.5) / count
            x, y = round(x0 + part * (x1 - x0), 2), round(y0 + part * (y1 - y0), 2)
            piece = shapely.Point(x, y).buffer(0.5 * _HEDGE_M)
            if shapely.intersects(paths, piece):
                continue
            wood = shapely.box(-0.3 * _HEDGE_WIDTH_M, -0.49 * _HEDGE_M, 0.3 * _HEDGE_WIDTH_M,
                               0.49 * _HEDGE_M)  # fmt: skip
            wood = affinity.translate(affinity.rotate(wood, yaw, origin=(0, 0)), x, y)
            if not shapely.intersects(wood, planted).any():
                planted.append(wood)
                mesh = pieces[int(rng.integers(len(pieces)))]
                placement.put("Hedge", CityObjectLabel.VEGETATION, mesh, (x, y, yaw))


def plant_woods(
    placement: SceneryPlacement,
    ground: Surfaces,
    lots: list[Lot],
    kept_free: Sequence[BaseGeometry],
    turned: float,
    rng: np.random.Generator,
) -> None:
    """Groups of trees in the country around the roads; see :func:`plant_gardens`.

    Nobody comes near them: their trees have few triangles.
    """
    taken = _taken(
        _paved(ground, kept_free), ground, lots,
        from_paved_m=_FROM_ROADS_M, from_houses_m=_FROM_HOUSES_M,
    )  # fmt: skip
    shapely.prepare(taken)
    area = ground.terrain.buffer(-_WOOD_RADIUS_M)
    count = min(max(_WOODS[0], round((area.area - taken.area) / _M2_PER_WOOD)), _WOODS[1])
    trees: list[tuple[float, float]] = []
    for x, y in _scattered(area, taken, count, rng, apart_m=3.0 * _WOOD_RADIUS_M):
        wanted = int(rng.integers(*_WOOD_TREES))
        for dx, dy in rng.normal(scale=0.6 * _WOOD_RADIUS_M, size=(4 * wanted, 2)):
            place = (round(x + float(dx), 2), round(y + float(dy), 2))
            if not wanted or shapely.contains_xy(taken, *place):
                continue
            if not shapely.contains_xy(ground.terrain, *place):
                continue
            if all(math.dist(place, other) > _WOOD_APART_M for other in trees[-40:]):
                trees.append(place)
                wanted -= 1
    for place in trees:
        height = float(rng.uniform(7.0, 13.0))
        (own,) = rng.spawn(1)
        pointed = bool(rng.random() < 0.3)
        mesh = far_tree_mesh(height, own, pointed=pointed, autumn=bool(rng.random() < turned))
        placement.put("Tree_Wood", CityObjectLabel.VEGETATION, mesh, (*place, 0.0))


def grass_tufts(
    ground: Surfaces, surface: LevelSurface, rng: np.random.Generator
) -> list[TriangleMesh]:
    """Tufts where grass meets what is paved; none where there is no grass."""
    paved = shapely.union_all([ground.road, ground.sidewalk])
    rims = shapely.get_parts(shapely.get_rings(shapely.get_parts(paved)))
    lengths = shapely.length(rims)
    step = max(_TUFT_STEP_M, float(lengths.sum()) / _MOST_TUFTS)
    found = [np.empty((0, 2))]
    for rim, length in zip(rims, lengths.tolist(), strict=True):
        at = np.arange(float(rng.uniform(0.0, step)), length, step)
        here = shapely.get_coordinates(shapely.line_interpolate_point(rim, at))
        off = rng.uniform(-1.0, 1.0, (len(at), 2)) * _TUFT_REACH_M
        found.append(here + off)
    places = np.concatenate(found).round(2)
    places = places[surface.material(places) == Material.GRASS]
    shapely.prepare(paved)
    places = places[~shapely.contains_xy(paved.buffer(_TUFT_CLEAR_M), places[:, 0], places[:, 1])]
    if not len(places):
        return []
    return [tuft_mesh(np.column_stack([places, surface.height(places)]), rng)]


def _paved(ground: Surfaces, kept_free: Sequence[BaseGeometry]) -> BaseGeometry:
    """Roads, sidewalks and medians, and what else has no room for green."""
    return shapely.union_all([ground.road, ground.sidewalk, ground.median, *kept_free])


def _taken(
    paved: BaseGeometry,
    ground: Surfaces,
    lots: list[Lot],
    *,
    from_paved_m: float,
    from_houses_m: float,
) -> BaseGeometry:
    """Where nothing is planted: parks, and what is near to paved ground and houses."""
    houses = [lot.footprint.buffer(from_houses_m) for lot in lots]
    return shapely.union_all([paved.buffer(from_paved_m), *ground.parks, *houses])


def _plant_trees(
    placement: SceneryPlacement,
    places: Sequence[tuple[float, float]],
    turned: float,
    rng: np.random.Generator,
) -> None:
    for place in places:
        kind = TREE_KINDS[int(rng.integers(len(TREE_KINDS)))]
        plant(placement, kind, (*place, 0.0), rng, autumn=bool(rng.random() < turned))


def _scattered(
    area: BaseGeometry,
    taken: BaseGeometry,
    count: int,
    rng: np.random.Generator,
    *,
    apart_m: float = _APART_M,
) -> list[tuple[float, float]]:
    """At most ``count`` random places with room around them."""
    x0, y0, x1, y1 = area.bounds
    shapely.prepare(area)
    shapely.prepare(taken)
    places: list[tuple[float, float]] = []
    for _ in range(count * 30):
        if len(places) == count:
            break
        x, y = round(float(rng.uniform(x0, x1)), 2), round(float(rng.uniform(y0, y1)), 2)
        if not shapely.contains_xy(area, x, y) or shapely.contains_xy(taken, x, y):
            continue
        if any(math.dist((x, y), other) < apart_m for other in places):
            continue
        places.append((x, y))
    return places
