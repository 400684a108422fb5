"""Pedestrians below their umbrellas: a label has both, a detector's class `person` does not."""

from __future__ import annotations

from functools import cache

import numpy as np

from carstage.dataset import Frame
from carstage.dataset.masks import decode_mask
from carstage.geometry.camera import optical_from_world
from carstage.geometry.coordinates import pose_matrix, transform_points
from carstage_sim.content.pedestrians import walking_meshes
from carstage_sim.content.people import has_umbrella
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue

Box = tuple[float, float, float, float]

_PEDESTRIANS = frozenset({"walker_adult", "walker_child"})
_BESIDE_M = 0.30
"""Only an umbrella reaches so far from the middle of who carries it, so high."""
_HIGH = 0.6
"""Of the half height above the middle."""


def boxes_below_umbrellas(frame: Frame, camera: str) -> dict[int, Box]:
    """By track id, the box of what is seen of a pedestrian below the umbrella's rim.

    Args:
        frame: a moment in rain.
        camera: whose picture.
    """
    found: dict[int, Box] = {}
    for row in frame.camera_objects.get(camera, ()):
        one = frame.objects[row["track_id"]]
        if not row["bbox_modal"] or one["class"] not in _PEDESTRIANS:
            continue
        rim = rim_m(one["blueprint"])
        if rim is None or not row["mask_modal"]:
            continue
        sensor = frame.episode.sensor(camera).calibration_at(frame.k)
        optical = optical_from_world(frame.world_from_sensor(camera))
        world = pose_matrix(one["actor_location"], one["actor_rotation_deg"])
        level = sensor.project(transform_points(optical @ world, np.array([0.0, 0.0, rim])))[1]
        mask = decode_mask(row["mask_modal"], sensor.height, sensor.width)
        v, u = np.nonzero(mask)
        below = v >= level
        if below.any():
            v, u = v[below], u[below]
            found[row["track_id"]] = (u.min(), v.min(), u.max() + 1, v.max() + 1)
    return found


@cache
def rim_m(blueprint: str) -> float | None:
    """Height of an umbrella's rim above the middle of who carries it; None for nobody."""
    known = catalogue().get(blueprint)
    if known is None or not has_umbrella(blueprint):
        return None
    mesh = walking_meshes(blueprint, known.box_extent, [0], umbrella=True)[0]
    points = mesh.vertices[np.unique(mesh.triangles[mesh.material == Material.BAG])]
    high = points[:, 2] > _HIGH * known.box_extent[2]
    wide = np.hypot(points[:, 0], points[:, 1]) > _BESIDE_M
    return float(points[high & wide, 2].min())
