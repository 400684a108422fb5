"""Rows of ``objects.parquet``: one per object of a frame, independent of cameras."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from carstage.annotation.classes import TRAFFIC_LIGHT
from carstage.annotation.pixels import visibility_token
from carstage.annotation.riders import rider_object_row
from carstage.annotation.scene import Scene
from carstage.geometry import (
    flu_rotation,
    length,
    multiply,
    quaternion_from_matrix,
    rotate,
    rotation_deg,
    transform_points,
    wrap_angle,
)
from carstage.spec import LabelsSpec

VisiblePixels = tuple[int, float]
"""Visible and amodal pixels of an object, summed over the cameras."""


def object_rows(
    scene: Scene,
    keys: Mapping[str, Any],
    ego_id: int,
    labels: LabelsSpec,
    *,
    acceleration_valid: bool,
    lidar_points: Mapping[int, list[tuple[str, int]]],
    radar_points: Mapping[int, list[tuple[str, int]]],
    pixels: Mapping[int, VisiblePixels] | None,
    riders: Mapping[int, int] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Build the rows.

    Args:
        scene: the frame's actors.
        keys: ``k``, ``timestamp_s`` and ``episode_id``.
        ego_id: actor id of the ego.
        labels: what the spec asks of them.
        acceleration_valid: false in an episode's very first frame.
        lidar_points: by actor id, points per LiDAR.
        radar_points: by actor id, detections per radar.
        pixels: by actor id; actors that no camera can see are left out. None: no camera looked.
        riders: by id of their two-wheelers, the tag of riders that a camera sees.
    """
    to_ego = scene.ego_from_world[:3, :3]
    box_rotation = scene.world_from_box[:, :3, :3]
    box_center = scene.world_from_box[:, :3, 3]
    center_ego = transform_points(scene.ego_from_world, box_center)
    rotation_ego = rotation_deg(multiply(to_ego, box_rotation))
    distance = length(box_center - scene.world_from_ego[:3, 3])
    columns = {
        "box_center": box_center,
        "box_rotation_deg": rotation_deg(box_rotation),
        "box_quaternion": quaternion_from_matrix(flu_rotation(box_rotation)),
        "box_extent": scene.extent,
        "box_center_ego": center_ego,
        "box_yaw_ego": wrap_angle(np.radians(rotation_ego[:, 1])),
        "box_rotation_ego_deg": rotation_ego,
        "distance_ego": distance,
    }
    box = {name: values.tolist() for name, values in columns.items()}
    location = scene.location.tolist()
    rotation = scene.rotation_deg.tolist()
    velocity = scene.velocity.tolist()
    velocity_ego = rotate(to_ego, scene.velocity).tolist()
    acceleration = scene.acceleration.tolist()
    acceleration_ego = rotate(to_ego, scene.acceleration).tolist()
    angular_velocity = np.radians(scene.angular_velocity_deg).tolist()
    lights: Mapping[str, int] = scene.world.meta.get("vehicle_lights", {})
    signals: Mapping[str, str] = scene.world.meta.get("traffic_lights", {})

    rows = []
    for i, fact in enumerate(scene.facts):
        info = fact.info
        has_box = labels.boxes_3d and bool(scene.valid[i])
        visibility = None
        if labels.pixels and pixels is not None:
            visibility = _visibility(pixels.get(info.id))
        rows.append(
            {
                "k": keys["k"],
                "timestamp_s": keys["timestamp_s"],
                "track_id": info.id,
                "episode_id": keys["episode_id"],
                "instance_uid": f"{keys['episode_id']}:{info.id}",
                "class": fact.object_class,
                "blueprint": info.type_id,
                "base_type": info.attributes.get("base_type", ""),
                "special_type": info.attributes.get("special_type", ""),
                "role_name": info.attributes.get("role_name", ""),
                "is_static": fact.is_static,
                "is_ego": info.id == ego_id,
                "is_dormant": None,
                **{name: values[i] if has_box else None for name, values in box.items()},
                "box_source": fact.box.source,
                "actor_location": location[i],
                "actor_rotation_deg": rotation[i],
                "velocity": velocity[i],
                "acceleration": acceleration[i] if acceleration_valid else None,
                "velocity_ego": velocity_ego[i],
                "acceleration_ego": acceleration_ego[i] if acceleration_valid else None,
                # The server does not keep walkers' angular velocity.
                "angular_velocity": None if fact.is_walker else angular_velocity[i],
                "num_lidar_points": lidar_points.get(info.id, []),
                "num_radar_points": radar_points.get(info.id, []),
                "visibility": visibility,
                "visibility_token": None if visibility is None else visibility_token(visibility),
                "light_state": None if fact.is_walker else lights.get(str(info.id)),
                "traffic_light_state": signals.get(str(info.parent))
                if fact.object_class == TRAFFIC_LIGHT
                else None,
                "parent_track_id": info.parent or None,
                "semantic_tags": list(info.semantic_tags),
            }
        )
        if info.id in riders:
            rows.append(rider_object_row(rows[-1], rider_tag=riders[info.id]))
    return rows


def _visibility(pixels: VisiblePixels | None) -> float:
    """Visible over amodal pixels; 0 for what no camera sees."""
    if pixels is None or pixels[1] <= 0.0:
        return 0.0
    return pixels[0] / pixels[1]
