"""Everything that stands on the ground of a town: buildings, trees, lamps, signs, benches."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from carstage_sim.content.buildings import building_mesh
from carstage_sim.content.props import prop_mesh
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
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.frontage import Frontage, frontages
from carstage_sim.maps.greenery import (
    STREET_TREES,
    plant,
    plant_gardens,
    plant_parks,
    plant_woods,
    share_turned,
)
from carstage_sim.maps.lots import skyline_lots, street_lots
from carstage_sim.maps.parking import parked_vehicles
from carstage_sim.maps.placement import SceneryPlacement
from carstage_sim.maps.signals import SPEED_LIMIT, STOP, YIELD, SignalPlan
from carstage_sim.maps.strips import Strip
from carstage_sim.maps.surfaces import Surfaces

_MOUTH_CLEARANCE_M = 13.0
"""No trees this near a junction: they would hide lights and walkers from drivers."""
_STEP_M = 8.0
_FROM_KERB_M = 0.8
_PIT_HALF_M = 0.6
_BRIDGE_CLEARANCE_M = 3.0
_FROM_POSTS_M = 0.4
"""Room between houses and the middle of masts and signs."""
_FURNITURE = (
    ("BikeParking", "bikeparking", (0.35, 0.75, 0.4)),
    ("Mailbox", "mailbox", (0.22, 0.28, 0.6)),
    ("PlantPot", "plantpot", (0.3, 0.3, 0.5)),
    ("TrashCan", "trashcan", (0.25, 0.25, 0.5)),
)
"""What stands at kerbs where no bench, bin or hydrant does: name, kind of prop, half sizes."""
_SUNK_M = 0.025
"""How far furniture reaches into the ground, which may slope."""


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
    lot_rng, house_rng, street_rng, green_rng, parking_rng, season_rng = rng.spawn(6)
    placement = SceneryPlacement()
    _put_signs(placement, plan)
    if bare:
        return placement
    turned = share_turned(season_rng)
    streets = frontages(lanes)
    # The far side of a T is a frontage too: it closes the view down the street that ends there.
    fronts = streets + frontages(lanes, inside_junctions=True)
    free = [bridge.buffer(_BRIDGE_CLEARANCE_M) for bridge in bridges]
    posts = [shapely.Point(signal.location[:2]) for signal in plan.signals]
    standing = [post.buffer(_FROM_POSTS_M) for post in posts]
    lots = street_lots(fronts, ground, [*ground.parks, *free, *standing], lot_rng)
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
        placement.pits += _furnish(placement, street, turned, street_rng)
    for vehicle in parked_vehicles(lanes, ground, parking_rng):
        name = "Parked_" + vehicle.kind.type_id.removeprefix("vehicle.").replace(".", "_")
        placement.put(name, vehicle.kind.label, vehicle.mesh, vehicle.place)
    plant_gardens(placement, ground, lots, free, turned, green_rng)
    plant_parks(placement, ground, turned, green_rng)
    plant_woods(placement, ground, lots, free, turned, green_rng)
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
    placement: SceneryPlacement, street: Frontage, turned: float, rng: np.random.Generator
) -> list[shapely.Polygon]:
    """Trees, lamps, benches, bins and hydrants along one sidewalk; returns the tree pits.

    ``turned``: share of the trees whose leaves have turned.
    """
    # Both sides of a street have the same trees.
    species = STREET_TREES[street.road_id % len(STREET_TREES)]
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
            plant(placement, species, place, rng, autumn=bool(rng.random() < turned))
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
            else:
                # Drawn apart, so that nothing else moves.
                (own,) = rng.spawn(1)
                name, prop, extent = _FURNITURE[int(own.integers(len(_FURNITURE)))]
                mesh = placed(prop_mesh(f"static.prop.{prop}", extent), (0.0, 0.0, -_SUNK_M))
                placement.put(name, CityObjectLabel.STATIC, mesh, _turned(place))
    return pits


def _turned(place: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, yaw = place
    return x, y, (yaw + 360.0) % 360.0 - 180.0
