"""Which labelled object each point of a labelled cloud is of."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.classes import VEHICLES
from carstage.exporters.clouds import LabelledCloud
from carstage.geometry import FloatArray, invert_pose, pose_matrix, transform_points
from carstage.tags import TAGS_0_9_14

_TAGS = {tag.name: value for value, tag in TAGS_0_9_14.items()}
_VEHICLE_TAGS = np.array([_TAGS[n] for n in ("Car", "Truck", "Bus", "Motorcycle", "Bicycle")])
_GROWN_M = 0.05


def point_objects(
    frame: Frame, cloud: LabelledCloud, world_from_lidar: FloatArray, own_id: int
) -> NDArray[np.int64]:
    """Track ids ``(N,)`` of the road users that points are of; 0: none.

    Actors are known by the id that the ray reports. Parked vehicles of the town have none: theirs
    are the points with a vehicle's tag in their boxes, grown by 5 cm.

    Args:
        frame: whose objects are asked for.
        cloud: the points.
        world_from_lidar: ``(4, 4)`` pose of the LiDAR, CARLA's axes.
        own_id: actor id of the vehicle under the LiDAR, whose points keep it.
    """
    tracks = [own_id, *(key for key, row in frame.objects.items() if is_road_user(row))]
    ids = cloud.objects.astype(np.int64)
    found = np.where(np.isin(ids, np.array(tracks, np.int64)), ids, 0)
    open_points = np.flatnonzero((found == 0) & np.isin(cloud.tags, _VEHICLE_TAGS))
    if len(open_points):
        places = cloud.points[open_points, :3].astype(np.float64)
        world = transform_points(world_from_lidar, places)
        found[open_points] = _in_boxes(world, _parked(frame))
    return found


def is_road_user(row: Row) -> bool:
    """Whether a row of ``objects.parquet`` is of a vehicle or a pedestrian."""
    name = row["class"]
    return name in VEHICLES or str(name).startswith("walker")


def _parked(frame: Frame) -> Iterable[Row]:
    return (
        row
        for _, row in sorted(frame.objects.items())
        if row["is_static"] and row["class"] in VEHICLES and row["box_center"] is not None
    )


def _in_boxes(world: FloatArray, rows: Iterable[Row]) -> NDArray[np.int64]:
    """Track id of the first box around each point ``(N, 3)``, 0 without one."""
    found = np.zeros(len(world), np.int64)
    for row in rows:
        box_from_world = invert_pose(pose_matrix(row["box_center"], row["box_rotation_deg"]))
        beyond = np.abs(transform_points(box_from_world, world)) - np.array(row["box_extent"])
        found[(found == 0) & np.all(beyond <= _GROWN_M, axis=1)] = row["track_id"]
    return found
