"""The files of OPV2V: point clouds as PCD with the intensity in the red channel, and YAML.

Sources: what OpenCOOD's reader takes (``opencood/data_utils/datasets/basedataset.py``,
``utils/pcd_utils.py``, ``utils/box_utils.py``, ``utils/transformation_utils.py``), and what
OpenCDA's ``core/common/data_dumper.py`` writes. Poses are x, y, z (m), roll, yaw, pitch (deg) in
CARLA's world axes; points are in CARLA's sensor axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from carstage.dataset import SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.geometry import FloatArray, invert_pose, rotation_deg

_KMH_PER_M_S: Final = 3.6
_BRIGHTEST: Final = 255.0
_PCD_POINT: Final = np.dtype([("xyz", "<f4", 3), ("rgb", "<u4")])
_VEHICLES: Final = ("car", "van", "truck", "bus", "motorcycle", "bicycle")
_PCD_HEADER: Final = """\
# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z rgb
SIZE 4 4 4 4
TYPE F F F F
COUNT 1 1 1 1
WIDTH {points}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {points}
DATA binary
"""


def pcd(points: NDArray[np.float32]) -> bytes:
    """A PCD file as Open3D reads it: the intensity is the red channel, in steps of 1/255.

    Args:
        points: ``(N, 4)`` float32 x, y, z (m), intensity from 0 to 1, CARLA's sensor axes.
    """
    rows = np.zeros(len(points), _PCD_POINT)
    rows["xyz"] = points[:, :3]
    red = np.rint(np.clip(points[:, 3], 0.0, 1.0) * _BRIGHTEST).astype(np.uint32)
    rows["rgb"] = red << 16
    return _PCD_HEADER.format(points=len(points)).encode("ascii") + rows.tobytes()


def pose_list(matrix: FloatArray) -> list[float]:
    """A ``(4, 4)`` pose as x, y, z (m), roll, yaw, pitch (deg)."""
    pitch, yaw, roll = rotation_deg(matrix[:3, :3]).tolist()
    return [*matrix[:3, 3].tolist(), roll, yaw, pitch]


def frame_document(
    frame: Frame,
    lidar_id: str,
    cameras: Sequence[SensorCalibration],
    *,
    is_roadside: bool,
    min_points: int,
    max_distance_m: float | None,
) -> dict[str, Any]:
    """What the YAML file of an agent's frame says.

    Args:
        frame: as the agent's.
        lidar_id: the LiDAR whose points are exported.
        cameras: those that are exported, in OPV2V's order.
        is_roadside: the agent is no vehicle.
        min_points: vehicles with fewer points of that LiDAR are left out.
        max_distance_m: vehicles farther from the agent are left out.
    """
    world_from_lidar = frame.world_from_sensor(lidar_id)
    place = pose_list(frame.world_from_ego)
    speed_m_s = 0.0 if frame.ego is None else float(frame.ego["speed"])
    document: dict[str, Any] = {
        "lidar_pose": pose_list(world_from_lidar),
        "true_ego_pos": place,
        "predicted_ego_pos": list(place),
        "ego_speed": speed_m_s * _KMH_PER_M_S,
        "plan_trajectory": [],
        "RSU": is_roadside,
        "vehicles": {
            int(track): vehicle_entry(row)
            for track, row in sorted(frame.objects.items())
            if _is_seen(row, lidar_id, min_points, max_distance_m)
        },
    }
    for number, camera in enumerate(cameras):
        world_from_camera = frame.world_from_sensor(camera.id)
        camera_from_lidar = invert_pose(world_from_camera) @ world_from_lidar
        document[f"camera{number}"] = {
            "cords": pose_list(world_from_camera),
            "intrinsic": np.asarray(camera.k, np.float64).tolist(),
            "extrinsic": camera_from_lidar.tolist(),
        }
    return document


def vehicle_entry(row: Mapping[str, Any]) -> dict[str, Any]:
    """A vehicle: OpenCOOD adds ``center`` to ``location`` without turning it.

    So ``center`` is told in the world's axes, for the box to be where it is.
    """
    box, pivot = np.array(row["box_center"]), np.array(row["actor_location"])
    pitch, yaw, roll = row["box_rotation_deg"]
    return {
        "location": pivot.tolist(),
        "center": (box - pivot).tolist(),
        "angle": [roll, yaw, pitch],
        "extent": list(row["box_extent"]),
        "speed": float(np.linalg.norm(row["velocity"])) * _KMH_PER_M_S,
    }


def _is_seen(
    row: Mapping[str, Any], lidar_id: str, min_points: int, max_distance_m: float | None
) -> bool:
    if row["class"] not in _VEHICLES or row["box_center"] is None:
        return False
    if max_distance_m is not None and row["distance_ego"] > max_distance_m:
        return False
    points = int(dict(row["num_lidar_points"]).get(lidar_id, 0))
    return points >= min_points


def write_yaml(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document; keys keep their order."""
    text = yaml.dump(document, Dumper=_DUMPER, default_flow_style=None, sort_keys=False)
    path.write_text(text, "utf-8")


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
