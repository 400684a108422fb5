"""Everything that stands on the ground of a town: buildings, trees, lamps, signs, benches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.content.buildings import building_mesh
from carstage_sim.content.solids import placed
from carstage_sim.content.street_furniture import (
    bench_mesh,
    bin_mesh,
    bus_shelter_mesh,
    hydrant_mesh,
    speed_sign_mesh,
    stop_sign_mesh,
    street_lamp_mesh,
    yield_sign_mesh,
)
from carstage_sim.content.trees import TREE_KINDS, TreeKind, tree_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.frontage import Frontage, frontages
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.maps.lots import Lot, skyline_lots, street_lots
from carstage_sim.maps.parking import parked_vehicles
from carstage_sim.maps.signals import SPEED_LIMIT, STOP, YIELD, SignalPlan
from carstage_sim.maps.strips import Strip
from carstage_sim.maps.surfaces import Surfaces
from carstage_sim.maps.town import LevelObject, MapLayer, OrientedBox
from carstage_sim.mesh import TriangleMesh

_MOUTH_CLEARANCE_M = 13.0
"""No trees this near a junction: they would hide lights and walkers from drivers."""
_STEP_M = 8.0
_FROM_KERB_M = 0.8
_PIT_HALF_M = 0.6
_STREET_TREES = [kind for kind in TREE_KINDS if not kind.cone]
_GARDEN_TREES = 32
_PARK_TREES = 25
_GARDEN_REACH_M = 90.0
_STEEPEST_LOT_M = 1.5
"""Difference of height under a building that its foot may bridge."""
_M2_PER_TREE = 7000.0
_MOST_TREES = 300
_BRIDGE_CLEARANCE_M = 3.0
_LAYERS = {
    CityObjectLabel.BUILDINGS: MapLayer.BUILDINGS,
    CityObjectLabel.VEGETATION: MapLayer.FOLIAGE,
    CityObjectLabel.POLES: MapLayer.STREET_LIGHTS,
    CityObjectLabel.STATIC: MapLayer.PROPS,
    CityObjectLabel.CAR: MapLayer.PARKED_VEHICLES,
    CityObjectLabel.TRUCK: MapLayer.PARKED_VEHICLES,
    CityObjectLabel.WALLS: MapLayer.WALLS,
}
"""Signs are no part of a layer: they stay."""


def _feet(mesh: TriangleMesh, place: tuple[float, float, float]) -> NDArray[np.float64]:
    """``(5, 2)`` the place and the corners of the mesh's rectangle there."""
    x, y, yaw = place
    (x0, y0, _), (x1, y1, _) = mesh.bounds.astype(np.float64)
    local = np.array([(0.0, 0.0), (x0, y0), (x0, y1), (x1, y0), (x1, y1)])
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    feet: NDArray[np.float64] = local @ np.array([[c, s], [-s, c]]) + np.array([x, y])
    return feet


@dataclass(slots=True)
class SceneryPlacement:
    """Collects things by their place in the plan, then sets them down and numbers them.

    Attributes:
        meshes: in world coordinates, with object ids.
        objects: what the ids mean.
        pits: squares of open soil in the sidewalks.
        buildings: their footprints.
    """

    pits: list[shapely.Polygon] = field(default_factory=list)
    buildings: list[shapely.Polygon] = field(default_factory=list)
    meshes: list[TriangleMesh] = field(default_factory=list)
    objects: list[LevelObject] = field(default_factory=list)
    waiting: list[tuple[str, CityObjectLabel, TriangleMesh, tuple[float, float, float]]] = field(
        default_factory=list
    )

    def put(
        self,
        name: str,
        label: CityObjectLabel,
        mesh: TriangleMesh,
        place: tuple[float, float, float],
    ) -> None:
        """Puts a thing at x, y (m) and yaw (deg); what height that is, turns out later."""
        self.waiting.append((name, label, mesh, place))

    @property
    def poles(self) -> list[tuple[float, float]]:
        """x, y of the feet of lamps and other poles."""
        return [(x, y) for _, kind, _, (x, y, _) in self.waiting if kind == CityObjectLabel.POLES]

    def set_down(self, surface: LevelSurface) -> None:
        """Puts everything on the ground, with its lowest part on the lowest ground under it.

        Houses for which the ground is too steep are not built.
        """
        if not self.waiting:
            return
        probes = np.stack([_feet(mesh, place) for _, _, mesh, place in self.waiting])
        heights = surface.height(probes.reshape(-1, 2)).reshape(probes.shape[:2])
        for (name, label, mesh, place), z in zip(self.waiting, heights, strict=True):
            wide = label == CityObjectLabel.BUILDINGS
            if wide and np.ptp(z) > _STEEPEST_LOT_M:
                continue
            self._place(name, label, mesh, (*place, float(z.min() if wide else z[0])))

    def _place(
        self,
        name: str,
        label: CityObjectLabel,
        mesh: TriangleMesh,
        place: tuple[float, float, float, float],
    ) -> None:
        x, y, yaw, z = place
        low, high = mesh.bounds.astype(np.float64)
        middle, half = (low + high) / 2, (high - low) / 2
        c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        center = (
            x + c * middle[0] - s * middle[1],
            y + s * middle[0] + c * middle[1],
            z + middle[2],
        )
        number = len(self.objects) + 1
        box = OrientedBox(
            tuple(round(float(v), 4) for v in center),  # type: ignore[arg-type]
            tuple(round(float(v), 4) for v in half),  # type: ignore[arg-type]
            (0.0, round(yaw, 6), 0.0),
        )
        self.objects.append(
            LevelObject(number, f"{name}_{number}", int(label), box, int(_LAYERS.get(label, 0)))
        )
        self.meshes.append(placed(mesh, (x, y, z), yaw_deg=yaw, object_id=number))


def scenery(
    ground: Surfaces,
    lanes: list[Strip],
    plan: SignalPlan,
    bridges: list[BaseGeometry],
    rng: np.random.Generator,
    *,
    bare: bool = False,
) -> SceneryPlacement:
    """All that stands on the ground, drawn from ``rng``; not yet set down.

    Args:
        ground, lanes: of the ground level.
        plan: for the signs.
        bridges: areas of the levels above, kept free below.
        rng: draws what and where.
        bare: signs only.
    """
    lot_rng, house_rng, street_rng, green_rng, parking_rng = rng.spawn(5)
    placement = SceneryPlacement()
    _put_signs(placement, plan)
    if bare:
        return placement
    streets = frontages(lanes)
    # The far side of a T is a frontage too: it closes the view down the street that ends there.
    fronts = streets + frontages(lanes, inside_junctions=True)
    free = [bridge.buffer(_BRIDGE_CLEARANCE_M) for bridge in bridges]
    lots = street_lots(fronts, ground, [*ground.parks, *free], lot_rng)
    lots += skyline_lots(ground, lots, free, lot_rng)
    placement.buildings = [lot.footprint for lot in lots]
    for lot in lots:
        mesh = building_mesh(
            lot.kind,
            lot.width_m,
            lot.depth_m,
            lot.floors,
            house_rng,
            detached=lot.detached,
            distant=lot.distant,
        )
        label = CityObjectLabel.BUILDINGS
        placement.put(f"Building_{lot.kind.name}", label, mesh, (lot.x, lot.y, lot.yaw_deg))
    for street in streets:
        placement.pits += _furnish(placement, street, street_rng)
    for vehicle in parked_vehicles(lanes, ground, parking_rng):
        name = "Parked_" + vehicle.kind.type_id.removeprefix("vehicle.").replace(".", "_")
        placement.put(name, vehicle.kind.label, vehicle.mesh, vehicle.place)
    _plant_gardens(placement, ground, lots, free, green_rng)
    _plant_parks(placement, ground, green_rng)
    return placement


def _put_signs(placement: SceneryPlacement, plan: SignalPlan) -> None:
    label = CityObjectLabel.TRAFFIC_SIGNS
    for sign in plan.signals:
        # Plates look against the traffic that they address.
        facing = (sign.lanes[0].yaw_deg if sign.lanes else sign.yaw_deg) + 180.0
        place = (sign.location[0], sign.location[1], (facing + 180.0) % 360.0 - 180.0)
        if sign.kind == SPEED_LIMIT and sign.value > 0.0:
            limit = round(sign.value)
            placement.put(f"SpeedLimit{limit}", label, speed_sign_mesh(limit), place)
        elif sign.kind == STOP:
            placement.put("StopSign", label, stop_sign_mesh(), place)
        elif sign.kind == YIELD:
            placement.put("YieldSign", label, yield_sign_mesh(), place)


def _furnish(
    placement: SceneryPlacement, street: Frontage, rng: np.random.Generator
) -> list[shapely.Polygon]:
    """Trees, lamps, benches, bins and hydrants along one sidewalk; returns the tree pits."""
    # Both sides of a street have the same trees.
    species = _STREET_TREES[street.road_id % len(_STREET_TREES)]
    pits = []
    stations = np.arange(_MOUTH_CLEARANCE_M, street.length_m - _MOUTH_CLEARANCE_M, _STEP_M)
    shelter = len(stations) // 2 if len(stations) > 6 and rng.random() < 0.35 else -1
    for number, station in enumerate(stations):
        place = street.from_kerb(float(station), _FROM_KERB_M)
        if number % 4 == 0:
            placement.put("StreetLamp", CityObjectLabel.POLES, street_lamp_mesh(), place)
        elif number % 2 == 1:
            if number in (shelter, shelter - 1):
                continue
            _plant(placement, species, place, rng)
            x, y, _ = place
            pits.append(
                shapely.box(x - _PIT_HALF_M, y - _PIT_HALF_M, x + _PIT_HALF_M, y + _PIT_HALF_M)
            )
        elif number in (shelter, shelter - 1):
            placement.put("BusShelter", CityObjectLabel.STATIC, bus_shelter_mesh(), place)
        else:
            kind = int(rng.integers(4))
            if kind == 0:
                placement.put("Bench", CityObjectLabel.STATIC, bench_mesh(), _turned(place))
            elif kind == 1:
                placement.put("Bin", CityObjectLabel.STATIC, bin_mesh(), place)
            elif kind == 2:
                placement.put("Hydrant", CityObjectLabel.STATIC, hydrant_mesh(), place)
    return pits


def _turned(place: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, yaw = place
    return x, y, (yaw + 360.0) % 360.0 - 180.0


def _plant(
    placement: SceneryPlacement,
    kind: TreeKind,
    place: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    height = float(rng.uniform(*kind.height_m))
    x, y, _ = place
    turn = round(float(rng.uniform(-180.0, 180.0)), 1)
    mesh = tree_mesh(kind, height, rng)
    placement.put(f"Tree_{kind.name}", CityObjectLabel.VEGETATION, mesh, (x, y, turn))


def _plant_gardens(
    placement: SceneryPlacement,
    ground: Surfaces,
    lots: list[Lot],
    kept_free: Sequence[BaseGeometry],
    rng: np.random.Generator,
) -> None:
    """Trees behind the houses and around the town."""
    paved = shapely.union_all([ground.road, ground.sidewalk, ground.median, *kept_free])
    houses = [lot.footprint.buffer(3.5) for lot in lots]
    taken = shapely.union_all([paved.buffer(4.0), *ground.parks, *houses])
    shapely.prepare(taken)
    area = ground.road.convex_hull.buffer(_GARDEN_REACH_M)
    count = min(max(_GARDEN_TREES, round(area.area / _M2_PER_TREE)), _MOST_TREES)
    _scatter(placement, area, taken, count, rng)


def _plant_parks(placement: SceneryPlacement, ground: Surfaces, rng: np.random.Generator) -> None:
    for park in ground.parks:
        paths = shapely.union_all([path.buffer(1.5) for path in ground.park_paths])
        _scatter(placement, park.buffer(-3.0), paths, _PARK_TREES, rng)
        ring = park.buffer(-7.6).exterior
        for part in np.linspace(0.05, 0.95, 12):
            at = ring.interpolate(part, normalized=True)
            ahead = ring.interpolate(part + 0.005, normalized=True)
            yaw = math.degrees(math.atan2(ahead.y - at.y, ahead.x - at.x)) + 90.0
            mesh = bench_mesh()
            placement.put("Bench", CityObjectLabel.STATIC, mesh, (at.x, at.y, round(yaw, 1)))


def _scatter(
    placement: SceneryPlacement,
    area: shapely.Polygon,
    taken: shapely.Geometry,
    count: int,
    rng: np.random.Generator,
) -> None:
    """Trees at random places with room around them."""
    x0, y0, x1, y1 = area.bounds
    shapely.prepare(area)
    planted: list[tuple[float, float]] = []
    for _ in range(count * 30):
        if len(planted) == count:
            return
        x, y = round(float(rng.uniform(x0, x1)), 2), round(float(rng.uniform(y0, y1)), 2)
        if not shapely.contains_xy(area, x, y) or shapely.contains_xy(taken, x, y):
            continue
        if any(math.dist((x, y), other) < 6.0 for other in planted):
            continue
        planted.append((x, y))
        _plant(placement, TREE_KINDS[int(rng.integers(len(TREE_KINDS)))], (x, y, 0.0), rng)
