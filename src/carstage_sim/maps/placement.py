"""Things by their place in the plan, which are then set down on the ground and numbered."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from carstage_sim.content.solids import placed
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.drape import Drape
from carstage_sim.maps.ground_mesh import BELOW_DECK_M, LevelSurface
from carstage_sim.maps.town import LevelObject, MapLayer, OrientedBox
from carstage_sim.mesh import TriangleMesh

_STEEPEST_LOT_M = 1.5
"""Difference of height under a building that its foot may bridge."""
_FOOT_M = 0.002
"""What is no higher than this above a thing's origin is its foot, which reaches the ground."""
_TREAD_M = 0.005
"""What of a tyre is no higher than this touches the road."""
_ON_WHEELS = (CityObjectLabel.CAR, CityObjectLabel.TRUCK)
_BUILDINGS = CityObjectLabel.BUILDINGS
_FROM_WALLS_M = 0.05
"""Twigs end this far from walls."""
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


@dataclass(frozen=True, slots=True)
class _Foot:
    """What of a thing touches the ground.

    Attributes:
        rows: numbers of its vertices.
        places: ``(F, 2)`` where they are in the plan, world metres.
    """

    rows: NDArray[np.intp]
    places: NDArray[np.float64]


def _reaches_a_bridge(
    mesh: TriangleMesh,
    place: tuple[float, float, float],
    z_m: float,
    ceilings: Sequence[tuple[BaseGeometry, Drape]],
) -> bool:
    """Whether a thing that stands at a height ends above the underside of a bridge over it."""
    x, y, yaw = place
    (x0, y0, _), (x1, y1, top) = mesh.bounds.astype(np.float64)
    around = affinity.rotate(shapely.box(x0, y0, x1, y1), yaw, origin=(0.0, 0.0))
    around = affinity.translate(around, x, y)
    return any(
        z_m + top > float(lanes.height(np.array([[x, y]]))[0]) - BELOW_DECK_M
        and area.intersects(around)
        for area, lanes in ceilings
    )


def _foot(label: CityObjectLabel, mesh: TriangleMesh, place: tuple[float, float, float]) -> _Foot:
    local = mesh.vertices.astype(np.float64)
    limit = _TREAD_M if label in _ON_WHEELS else _FOOT_M
    rows = np.flatnonzero(local[:, 2] <= max(limit, float(local[:, 2].min()) + _FOOT_M))
    foot = local[rows]
    x, y, yaw = place
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    places = np.stack([x + c * foot[:, 0] - s * foot[:, 1], y + s * foot[:, 0] + c * foot[:, 1]], 1)
    return _Foot(rows, places)


def _let_down(mesh: TriangleMesh, foot: _Foot, below_m: NDArray[np.float64]) -> TriangleMesh:
    """A mesh whose foot reaches ground that is that far below its own, ``(F,)``."""
    vertices = mesh.vertices.copy()
    vertices[foot.rows, 2] -= below_m.astype(np.float32)
    return replace(mesh, vertices=vertices)


def _on_wheels(
    mesh: TriangleMesh, foot: _Foot, heights: NDArray[np.float64]
) -> tuple[float, tuple[float, float]]:
    """Height (m), pitch and roll (deg) of the plane under four wheels."""
    x, y = mesh.vertices[foot.rows, :2].astype(np.float64).T
    front, right = x > 0.0, y > 0.0
    middle = {
        (ahead, aside): (x[here].mean(), y[here].mean(), heights[here].mean())
        for ahead in (True, False)
        for aside in (True, False)
        for here in [(front == ahead) & (right == aside)]
    }
    z = {way: float(at[2]) for way, at in middle.items()}
    (x0, y0, _), (x1, y1, _) = middle[False, False], middle[True, True]
    ahead, behind = (z[True, True] + z[True, False]) / 2, (z[False, True] + z[False, False]) / 2
    to_right, to_left = (z[True, True] + z[False, True]) / 2, (z[True, False] + z[False, False]) / 2
    climb, bank = (ahead - behind) / (x1 - x0), (to_left - to_right) / (y1 - y0)
    middle_m = (ahead + behind) / 2 - climb * (x0 + x1) / 2 + bank * (y0 + y1) / 2
    lean = round(math.degrees(math.atan(climb)), 4), round(math.degrees(math.atan(bank)), 4)
    return float(middle_m), lean


def _walls(feet: list[_Foot]) -> shapely.STRtree:
    """The ground plans of buildings with some air around them."""
    plans = [shapely.MultiPoint(foot.places).convex_hull for foot in feet]
    return shapely.STRtree([plan.buffer(_FROM_WALLS_M, join_style="mitre") for plan in plans])


def _pruned(
    mesh: TriangleMesh, place: tuple[float, float, float], walls: shapely.STRtree
) -> TriangleMesh:
    """A plant without what would grow into buildings; see :func:`_walls`."""
    local, (x, y, yaw) = mesh.vertices[:, :2].astype(np.float64), place
    reach = float(np.abs(local).max()) * math.sqrt(2.0)
    near = walls.query(shapely.box(x - reach, y - reach, x + reach, y + reach))
    if not len(near):
        return mesh
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    at_x, at_y = x + c * local[:, 0] - s * local[:, 1], y + s * local[:, 0] + c * local[:, 1]
    inside = np.zeros(len(local), np.bool_)
    for plan in walls.geometries[near].tolist():
        inside |= shapely.contains_xy(plan, at_x, at_y)
    kept = ~inside[mesh.triangles].any(axis=1)
    if kept.all() or not kept.any():
        return mesh
    used, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    return TriangleMesh(
        mesh.vertices[used], triangles.reshape(-1, 3).astype(mesh.triangles.dtype),
        mesh.normals[kept], mesh.material[kept], mesh.tag[kept], mesh.object_id[kept],
    )  # fmt: skip


@dataclass(slots=True)
class SceneryPlacement:
    """Collects things by their place in the plan, then sets them down and numbers them.

    Attributes:
        meshes: in world coordinates, with object ids.
        objects: what the ids mean.
        pits: squares of open soil in the sidewalks.
        buildings: their footprints.
        no_bushes: x, y of trees and benches.
    """

    pits: list[shapely.Polygon] = field(default_factory=list)
    buildings: list[shapely.Polygon] = field(default_factory=list)
    no_bushes: list[tuple[float, float]] = field(default_factory=list)
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

    def set_down(
        self, surface: LevelSurface, ceilings: Sequence[tuple[BaseGeometry, Drape]] = ()
    ) -> None:
        """Puts everything on the ground.

        Things stand upright on the highest ground under their foot, which reaches down to the
        ground elsewhere. Vehicles lean as the road under their wheels does. Houses for which the
        ground is too steep are not built, and nothing is put where it would reach into a bridge.
        What grows is pruned where it meets a wall.

        Args:
            surface: the ground.
            ceilings: areas of bridges with their lanes' heights.
        """
        if not self.waiting:
            return
        feet = [_foot(label, mesh, place) for _, label, mesh, place in self.waiting]
        # Many vertices of a foot are at one place.
        places, rows = np.unique(
            np.concatenate([foot.places for foot in feet]), axis=0, return_inverse=True
        )
        found = surface.height(places)[rows.reshape(-1)]
        ends = np.cumsum([len(foot.rows) for foot in feet])[:-1]
        standing = [
            (*thing, foot, heights)
            for thing, foot, heights in zip(self.waiting, feet, np.split(found, ends), strict=True)
            if (thing[1] != _BUILDINGS or np.ptp(heights) <= _STEEPEST_LOT_M)
            and not _reaches_a_bridge(thing[2], thing[3], float(heights.max()), ceilings)
        ]
        walls = _walls([foot for _, label, *_, foot, _ in standing if label == _BUILDINGS])
        for name, label, mesh, place, foot, heights in standing:
            if label in _ON_WHEELS:
                z, lean = _on_wheels(mesh, foot, heights)
                self._place(name, label, mesh, (*place, z), lean)
                continue
            z = float(heights.max())
            below = np.maximum(z - heights, 0.0)
            upright = _let_down(mesh, foot, below) if below.any() else mesh
            if label == CityObjectLabel.VEGETATION:
                upright = _pruned(upright, place, walls)
            self._place(name, label, upright, (*place, z))

    def _place(
        self,
        name: str,
        label: CityObjectLabel,
        mesh: TriangleMesh,
        place: tuple[float, float, float, float],
        lean_deg: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        x, y, yaw, z = place
        low, high = mesh.bounds.astype(np.float64)
        middle, half = (low + high) / 2, (high - low) / 2
        rotation = (lean_deg[0], round(yaw, 6), lean_deg[1])
        center = rotation_matrix(np.array([lean_deg[0], yaw, lean_deg[1]])) @ middle + (x, y, z)
        number = len(self.objects) + 1
        box = OrientedBox(
            tuple(round(float(v), 4) for v in center),  # type: ignore[arg-type]
            tuple(round(float(v), 4) for v in half),  # type: ignore[arg-type]
            rotation,
        )
        self.objects.append(
            LevelObject(number, f"{name}_{number}", int(label), box, int(_LAYERS.get(label, 0)))
        )
        self.meshes.append(
            placed(mesh, (x, y, z), yaw_deg=yaw, lean_deg=lean_deg, object_id=number)
        )
