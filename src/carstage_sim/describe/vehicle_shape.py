"""The shape of one vehicle as a JSON document: what a rig editor draws below the sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.world.blueprints import Blueprint, catalogue
from carstage_sim.world.state import ActorKind

_GAP_M = 0.02  # outlines bridge and leave out what is narrower
_MILLIMETRES = 3


class UnknownVehicleError(LookupError):
    """No vehicle has that blueprint id."""


def vehicle_shape(type_id: str) -> dict[str, Any]:
    """The document that ``--vehicle`` prints.

    Args:
        type_id: the blueprint's id.

    Returns:
        ``box`` (centre and half sizes), ``wheels`` (centre and radius), ``top`` (x, y) and ``side``
        (x, z) outlines as lists of rings, and ``parts``: corners of triangles, nine numbers each,
        by material. All in metres in the actor's frame: x forward, y right, z up, the origin on
        the ground.

    Raises:
        UnknownVehicleError: no vehicle has that id.
    """
    blueprint = catalogue().get(type_id)
    if blueprint is None or blueprint.kind is not ActorKind.VEHICLE:
        raise UnknownVehicleError(f"no vehicle is called {type_id!r}")
    mesh = _mesh(blueprint)
    corners = mesh.vertices[mesh.triangles]
    wheels = blueprint.vehicle.wheels if blueprint.vehicle is not None else ()
    return {
        "id": type_id,
        "box": {"location": list(blueprint.box_center), "extent": list(blueprint.box_extent)},
        "wheels": [
            {
                "location": [round(x, _MILLIMETRES) for x in wheel.position_m],
                "radius": wheel.radius_m,
            }
            for wheel in dict.fromkeys(wheels)  # both of an axle are one on a two-wheeler
        ],
        "top": _outline(corners[:, :, [0, 1]]),
        "side": _outline(corners[:, :, [0, 2]]),
        "parts": [
            {
                "material": Material(value).name.lower(),
                "corners": _rounded(corners[mesh.material == value].ravel()),
            }
            for value in np.unique(mesh.material)
        ],
    }


def _mesh(blueprint: Blueprint) -> TriangleMesh:
    """The mesh that the server draws, doors closed."""
    motion = blueprint.vehicle
    if motion is None:
        return vehicle_mesh(blueprint.id, blueprint.box_extent, blueprint.box_center)
    return vehicle_mesh(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(motion.front_axle_x_m, motion.rear_axle_x_m),
        wheel_radius_m=motion.wheels[0].radius_m,
    )


def _outline(triangles: NDArray[np.floating[Any]]) -> list[list[list[float]]]:
    """Outer rings of what triangles ``(T, 3, 2)`` cover together."""
    rings = np.concatenate([triangles, triangles[:, :1]], axis=1).astype(np.float64)
    shapes = shapely.make_valid(shapely.polygons(rings))
    covered = shapely.union_all(shapely.buffer(shapes, _GAP_M, quad_segs=1))
    shape = shapely.simplify(shapely.buffer(covered, -_GAP_M), _GAP_M / 4)
    parts = [part for part in shapely.get_parts(shape) if part.area > _GAP_M]
    return [
        [[round(float(x), _MILLIMETRES), round(float(y), _MILLIMETRES)] for x, y in ring]
        for ring in (shapely.get_coordinates(shapely.get_exterior_ring(part)) for part in parts)
    ]


def _rounded(values: NDArray[np.floating[Any]]) -> list[float]:
    return [float(value) for value in np.round(values.astype(np.float64), _MILLIMETRES)]
