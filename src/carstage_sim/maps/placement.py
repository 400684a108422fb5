"""Things by their place in the plan, which are then set down on the ground and numbered."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.content.solids import placed
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.maps.town import LevelObject, MapLayer, OrientedBox
from carstage_sim.mesh import TriangleMesh

_STEEPEST_LOT_M = 1.5
"""Difference of height under a building that its foot may bridge."""
_FOOT_M = 0.05
"""What is so little above the lowest point of a thing is its foot: a trunk's, not a crown's."""
_ON_WHEELS = (CityObjectLabel.CAR, CityObjectLabel.TRUCK)
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


def _feet(
    mesh: TriangleMesh, place: tuple[float, float, float], *, whole: bool
) -> NDArray[np.float64]:
    """``(5, 2)`` the place and the corners of the rectangle of the whole mesh or of its foot."""
    x, y, yaw = place
    corners = mesh.vertices.astype(np.float64)
    if not whole:
        corners = corners[corners[:, 2] < corners[:, 2].min() + _FOOT_M]
    (x0, y0, _), (x1, y1, _) = corners.min(axis=0), corners.max(axis=0)
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
        """Puts everything on the ground, with its foot on the lowest ground under it.

        What has wheels stands where its middle is. Houses for which the ground is too steep are not
        built.
        """
        if not self.waiting:
            return
        probes = np.stack(
            [
                _feet(mesh, place, whole=label == CityObjectLabel.BUILDINGS)
                for _, label, mesh, place in self.waiting
            ]
        )
        heights = surface.height(probes.reshape(-1, 2)).reshape(probes.shape[:2])
        for (name, label, mesh, place), z in zip(self.waiting, heights, strict=True):
            if label == CityObjectLabel.BUILDINGS and np.ptp(z) > _STEEPEST_LOT_M:
                continue
            low = z[0] if label in _ON_WHEELS else z.min()
            self._place(name, label, mesh, (*place, float(low)))

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
