"""What clients get to know of a town's scenery beyond its own list: sign faces, parts of lights.

In CARLA a level object's box bounds the meshes of one semantic tag. A sign here is one object with
its post, and a traffic light is an actor alone; clients get them by tag all the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from carstage_sim.content.street_furniture import traffic_light_mesh
from carstage_sim.geometry import pose_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LevelObject, OrientedBox, TrafficLightSite
from carstage_sim.mesh import TriangleMesh
from carstage_sim.world.signals.traffic_light_actors import head_boxes

_FIRST_LIGHT_PIECE = 1 << 32
"""Ids of parts of lights begin here; those of scenery count up from 1."""
_PIECES_PER_LIGHT, _MAST = 8, 2


def sign_faces(mesh: TriangleMesh, objects: Sequence[LevelObject]) -> dict[int, OrientedBox]:
    """Tight boxes of the signs' faces, without their posts, by object id.

    Args:
        mesh: of the town.
        objects: of the town; the mesh's ids count them from 1.
    """
    chosen = np.flatnonzero(mesh.tag == CityObjectLabel.TRAFFIC_SIGNS)
    ids = mesh.object_id[chosen]
    order = np.argsort(ids, kind="stable")
    found, start = np.unique(ids[order], return_index=True)
    faces: dict[int, OrientedBox] = {}
    for object_id, rows in zip(found.tolist(), np.split(chosen[order], start[1:]), strict=True):
        if object_id == 0:
            continue
        box = objects[object_id - 1].box
        points = mesh.vertices[mesh.triangles[rows].ravel()].astype(np.float64)
        faces[object_id] = tight_box(points, box.rotation_deg)
    return faces


def tight_box(points: np.ndarray, rotation_deg: tuple[float, float, float]) -> OrientedBox:
    """The smallest box with a given rotation around points ``(N, 3)`` in the world."""
    turn = pose_matrix((0.0, 0.0, 0.0), rotation_deg)[:3, :3]
    local = points @ turn
    low, high = local.min(axis=0), local.max(axis=0)
    x, y, z = (turn @ ((low + high) / 2.0)).round(4).tolist()
    ex, ey, ez = ((high - low) / 2.0).round(4).tolist()
    return OrientedBox((x, y, z), (ex, ey, ez), rotation_deg)


def light_heads(sites: Sequence[TrafficLightSite]) -> Iterator[LevelObject]:
    """The heads of the lights, as objects with ids and names of their own."""
    label = int(CityObjectLabel.TRAFFIC_LIGHT)
    for index, site in enumerate(sites):
        for part, box in enumerate(head_boxes(site)):
            name = f"TrafficLight_{site.sign_id}_TrafficLight_{part}"
            yield LevelObject(_piece_id(index, part), name, label, box)


def light_masts(sites: Sequence[TrafficLightSite]) -> Iterator[LevelObject]:
    """Their masts with the arms, likewise."""
    label = int(CityObjectLabel.POLES)
    for index, site in enumerate(sites):
        name = f"TrafficLight_{site.sign_id}_Pole_{_MAST}"
        yield LevelObject(_piece_id(index, _MAST), name, label, _mast_box(site))


def _piece_id(light: int, part: int) -> int:
    return _FIRST_LIGHT_PIECE + _PIECES_PER_LIGHT * light + part


def _mast_box(site: TrafficLightSite) -> OrientedBox:
    """The box of mast and arm."""
    mesh = traffic_light_mesh(site.head)
    corners = mesh.triangles[mesh.tag == CityObjectLabel.POLES].ravel()
    world_from_actor = pose_matrix(site.location, site.rotation_deg)
    points = mesh.vertices[corners].astype(np.float64)
    world = points @ world_from_actor[:3, :3].T + world_from_actor[:3, 3]
    return tight_box(world, site.rotation_deg)
