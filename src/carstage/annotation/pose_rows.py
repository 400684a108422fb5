"""Rows of ``sensor_poses.parquet``: where each sensor is in a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from carstage.annotation.rig import Mount
from carstage.annotation.scene import Scene
from carstage.geometry import multiply, rotation_deg


def pose_rows(
    scene: Scene,
    mounts: Sequence[Mount],
    carriers: Mapping[str, int],
    keys: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """One row per sensor.

    Args:
        scene: the frame's snapshot and the ego's pose.
        mounts: the sensors.
        carriers: by sensor, the actor that carries it; 0: fixed on the map.
        keys: ``k`` and ``timestamp_s``.
    """
    rows = []
    for mount in mounts:
        pose = mount.world_from_sensor(scene.world, scene.world_from_ego)
        rows.append(
            {
                "k": keys["k"],
                "timestamp_s": keys["timestamp_s"],
                "sensor_id": mount.sensor_id,
                "carrier_track_id": carriers.get(mount.sensor_id) or None,
                "location": pose[:3, 3].tolist(),
                "rotation_deg": rotation_deg(pose[:3, :3]).tolist(),
                "ego_from_sensor": multiply(scene.ego_from_world, pose).ravel().tolist(),
            }
        )
    return rows
