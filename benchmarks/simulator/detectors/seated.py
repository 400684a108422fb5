"""People in vehicles: a picture shows them behind glass, and no row of labels is theirs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.detectors.matching import LabelledObject
from carstage.dataset import Frame
from carstage.geometry.camera import optical_from_world
from carstage.geometry.coordinates import invert_pose, pose_matrix, transform_points
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.world.blueprints import catalogue

Row = Mapping[str, Any]
Array = NDArray[np.float64]

_VEHICLES = frozenset({"car", "van", "truck", "bus"})
_PERSON = (Material.SKIN, Material.HAIR, Material.CLOTH_UPPER)
_CLEAR = (*_PERSON, Material.GLASS, Material.GLASS_TINTED)
"""Materials that hide nobody's head."""
_THROUGH_WITHIN_M = 40.0
"""From farther away the simulator draws nothing behind glass."""
_APART_M = 0.35
"""Heads that are farther from each other are of two people."""


def seated_people(frame: Frame, camera: str) -> tuple[LabelledObject, ...]:
    """Who is seen in the vehicles of a picture; none of them is judged.

    Args:
        frame: the moment.
        camera: whose picture.
    """
    rows = [row for row in frame.camera_objects.get(camera, ()) if row["bbox_modal"]]
    vehicles = [frame.objects[row["track_id"]] for row in rows]
    near = [
        one
        for one, row in zip(vehicles, rows, strict=True)
        if one["class"] in _VEHICLES and row["distance"] < _THROUGH_WITHIN_M
    ]
    if not near:
        return ()
    sensor = frame.episode.sensor(camera).calibration_at(frame.k)
    optical = optical_from_world(frame.world_from_sensor(camera))
    eye = frame.world_from_sensor(camera)[:3, 3]
    size = np.array([sensor.width, sensor.height, sensor.width, sensor.height], np.float64)
    found = []
    for one in near:
        world = pose_matrix(one["actor_location"], one["actor_rotation_deg"])
        inside = transform_points(invert_pose(world), eye)
        for person in people_seen(one["blueprint"], inside):
            uv = sensor.project(transform_points(optical @ world, person))
            if np.isnan(uv).any():
                continue
            box = np.clip([*uv.min(axis=0), *uv.max(axis=0)], 0.0, size).astype(np.float32)
            if (box[2:] > box[:2]).all():
                names = frozenset({"person"})
                found.append(LabelledObject("person", names, box[None], judged=False))
    return tuple(found)


def people_seen(blueprint: str, eye: Array) -> Iterator[Array]:
    """``(N, 3)`` points of each person in a vehicle whose head is seen through its windows.

    Args:
        blueprint: of the vehicle.
        eye: where one looks from, in the vehicle's frame (m).
    """
    if blueprint not in catalogue():
        return
    mesh, people = _inside(blueprint)
    solid = mesh.triangles[~np.isin(mesh.material, _CLEAR)]
    for head, points in people:
        if not _hidden(mesh.vertices[solid].astype(np.float64), eye, head):
            yield points


@cache
def _inside(blueprint: str) -> tuple[TriangleMesh, tuple[tuple[Array, Array], ...]]:
    """A vehicle's mesh, and the middle of the head and the points of each person in it."""
    made = catalogue()[blueprint]
    physics = made.vehicle
    if physics is None:
        raise ValueError(f"{blueprint} is no vehicle")
    mesh = vehicle_mesh(
        blueprint,
        made.box_extent,
        made.box_center,
        axles_m=(physics.front_axle_x_m, physics.rear_axle_x_m),
        wheel_radius_m=physics.wheels[0].radius_m,
    )

    def of(materials: Sequence[Material]) -> Array:
        chosen = mesh.triangles[np.isin(mesh.material, materials)]
        return mesh.vertices[np.unique(chosen)].astype(np.float64)

    heads: list[Array] = []
    for point in of([Material.HAIR]):
        if all(np.hypot(*(point - head)[:2]) > _APART_M for head in heads):
            heads.append(point)
    points = of(_PERSON)
    if not heads:
        return mesh, ()
    away = np.linalg.norm(points[:, None, :2] - np.array(heads)[None, :, :2], axis=2)
    nearest = away.argmin(axis=1)
    people = []
    for k in range(len(heads)):
        body = points[nearest == k]
        crown = body[body[:, 2] > body[:, 2].max() - 0.2]
        people.append((crown.mean(axis=0), body))
    return mesh, tuple(people)


def _hidden(triangles: Array, eye: Array, point: Array) -> bool:
    """Whether a triangle of ``(T, 3, 3)`` lies between two points (Möller and Trumbore 1997)."""
    way = point - eye
    edge1, edge2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(way, edge2)
    determinant = (edge1 * normal).sum(axis=1)
    scale = np.where(np.abs(determinant) > 1e-12, determinant, np.inf)
    away = eye - triangles[:, 0]
    u = (away * normal).sum(axis=1) / scale
    across = np.cross(away, edge1)
    v = across @ way / scale
    t = (edge2 * across).sum(axis=1) / scale
    met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0) & (t < 1.0)
    return bool(met.any())
