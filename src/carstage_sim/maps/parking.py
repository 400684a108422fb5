"""Parked vehicles: in parking lanes, and on shoulders beside a sidewalk that are wide enough."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import shapely
from shapely import affinity

from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.strips import Strip
from carstage_sim.maps.surfaces import Surfaces
from carstage_sim.mesh import Material, TriangleMesh

_FROM_JUNCTION_M = 12.0
_FROM_CROSSWALK_M = 5.0
_GAP_M = (1.0, 2.2)
_OCCUPIED = 0.55
_STEEPEST = 0.03
"""On steeper streets level bodies would hang in the air."""
_WIDE_SHOULDER_M = 2.4
_BESIDE_WALK_M = 0.3
"""A lane is beside a sidewalk that is this near."""
_MOST_PARKED = 100
_PAINTS = (
    Material.PAINT_WHITE,
    Material.PAINT_SILVER,
    Material.PAINT_GREY,
    Material.PAINT_BLACK,
    Material.PAINT_BLUE,
    Material.PAINT_RED,
)


@dataclass(frozen=True, slots=True)
class _Room:
    """What is left free beside a vehicle whose mirrors count: to the kerb and to a driving lane."""

    from_kerb_m: float
    from_lanes_m: float


_AT_SHOULDER = _Room(from_kerb_m=0.2, from_lanes_m=0.3)
_IN_BAY = _Room(from_kerb_m=0.08, from_lanes_m=0.02)
"""A bay of 2.0 to 2.2 m, as streets have, holds a car of 1.8 m and its mirrors, and no more."""


@dataclass(frozen=True, slots=True)
class ParkedKind:
    """A model: its blueprint's id, half sizes (m), label, how often it is seen."""

    type_id: str
    extent: tuple[float, float, float]
    label: CityObjectLabel
    share: float


# Sizes as in the blueprint library.
_KINDS = (
    ParkedKind("vehicle.audi.a2", (1.853, 0.894, 0.775), CityObjectLabel.CAR, 0.22),
    ParkedKind("vehicle.nissan.micra", (1.817, 0.923, 0.751), CityObjectLabel.CAR, 0.22),
    ParkedKind("vehicle.toyota.prius", (2.257, 1.003, 0.762), CityObjectLabel.CAR, 0.22),
    ParkedKind("vehicle.audi.tt", (2.091, 0.997, 0.693), CityObjectLabel.CAR, 0.12),
    ParkedKind("vehicle.nissan.patrol", (2.302, 0.966, 0.927), CityObjectLabel.CAR, 0.12),
    ParkedKind("vehicle.mercedes.sprinter", (2.958, 0.994, 1.280), CityObjectLabel.TRUCK, 0.10),
)


@dataclass(frozen=True, slots=True)
class ParkedVehicle:
    """A vehicle that never moves: what, and x, y (m), yaw (deg)."""

    kind: ParkedKind
    place: tuple[float, float, float]
    paint: Material

    @property
    def mesh(self) -> TriangleMesh:
        """The vehicle in its own frame, painted."""
        mesh = _unpainted(self.kind)
        painted = np.where(mesh.material == Material.PAINT, np.uint8(self.paint), mesh.material)
        return replace(mesh, material=painted)


@cache
def _unpainted(kind: ParkedKind) -> TriangleMesh:
    """The model's mesh, which takes long to make; not to be written to."""
    x, y, z = kind.extent
    return vehicle_mesh(kind.type_id, (x, y, z), (0.0, 0.0, z), occupied=False, coarse=True)


def parked_vehicles(
    lanes: list[Strip], ground: Surfaces, rng: np.random.Generator
) -> list[ParkedVehicle]:
    """Vehicles at the kerbs of the ground level, clear of every driving lane."""
    driving = shapely.union_all([lane.polygon for lane in lanes if lane.kind not in _PARKED_ON])
    walks = [walk.buffer(_FROM_CROSSWALK_M) for walk in ground.crosswalks]
    blocked = shapely.union_all([ground.sidewalk, *walks])
    shapely.prepare(driving)
    shapely.prepare(blocked)
    shapely.prepare(ground.road)
    beside_walks = ground.sidewalk.buffer(_BESIDE_WALK_M)
    shapely.prepare(beside_walks)
    shares = np.array([kind.share for kind in _KINDS])
    shares /= shares.sum()
    found: list[ParkedVehicle] = []
    for lane in lanes:
        if not _is_for_parking(lane, beside_walks):
            continue
        room = _IN_BAY if lane.kind == "parking" else _AT_SHOULDER
        for kind, place in _row(lane, room, shares, rng):
            x, y, yaw = place
            box = shapely.box(-kind.extent[0], -kind.extent[1], kind.extent[0], kind.extent[1])
            area = affinity.translate(affinity.rotate(box, yaw, origin=(0, 0)), x, y)
            if shapely.dwithin(driving, area, room.from_lanes_m):
                continue
            if blocked.intersects(area) or not ground.road.contains(area):
                continue
            paint = _PAINTS[int(rng.integers(len(_PAINTS)))]
            found.append(ParkedVehicle(kind, place, paint))
    if len(found) > _MOST_PARKED:
        kept = np.sort(rng.permutation(len(found))[:_MOST_PARKED])
        found = [found[i] for i in kept.tolist()]
    return found


_PARKED_ON = frozenset({"parking", "shoulder", "sidewalk", "walking", "none", "border", "median"})


def _is_for_parking(lane: Strip, beside_walks: shapely.Geometry) -> bool:
    if lane.junction_id != -1 or np.abs(np.gradient(lane.z_m)).max() > _STEEPEST:
        return False
    if lane.kind == "parking":
        return True
    wide = lane.kind == "shoulder" and float(np.median(lane.width_m)) >= _WIDE_SHOULDER_M
    middle = lane.offset(1.0)[len(lane.center) // 2]
    return wide and bool(shapely.intersects_xy(beside_walks, middle[0], middle[1]))


def _row(
    lane: Strip, room: _Room, shares: np.ndarray, rng: np.random.Generator
) -> Iterator[tuple[ParkedKind, tuple[float, float, float]]]:
    """Vehicles one behind the other along the lane's outer edge, with gaps."""
    along_m, outer = lane.along_m, lane.offset(1.0)
    yaw = np.degrees(np.unwrap(np.radians(lane.yaw_deg)))
    station = _FROM_JUNCTION_M
    while True:
        kind = _KINDS[int(rng.choice(len(_KINDS), p=shares))]
        half_length, half_width, _ = kind.extent
        middle = station + half_length
        if middle + half_length > along_m[-1] - _FROM_JUNCTION_M:
            return
        station = middle + half_length + float(rng.uniform(*_GAP_M))
        if rng.random() >= _OCCUPIED:
            continue
        heading = float(np.interp(middle, along_m, yaw))
        inwards = np.radians(heading) - np.pi / 2
        x, y = (float(np.interp(middle, along_m, outer[:, k])) for k in range(2))
        x += (half_width + room.from_kerb_m) * float(np.cos(inwards))
        y += (half_width + room.from_kerb_m) * float(np.sin(inwards))
        yield kind, (round(x, 3), round(y, 3), round((heading + 180.0) % 360.0 - 180.0, 3))
