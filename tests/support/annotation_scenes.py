"""Scenes for label tests: a raw log's header, actors, snapshots, and solids seen by a camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.annotation import CameraImages, EpisodeLabeller
from carstage.annotation.pixels import BOX_MARGIN_M, BoxView
from carstage.geometry import Z_NEAR_M, FloatArray, rotation_matrix
from carstage.rawlog.reader import ActorInfo, WorldFrame

EGO_ID = 7
FAR_M = 1000.0
CAR_TAG, RIDER_TAG, WALKER_TAG, ROAD_TAG = 14, 13, 12, 1
CAR_EXTENT = (2.3, 0.95, 0.75)


def actor(
    actor_id: int,
    type_id: str = "vehicle.tesla.model3",
    *,
    location: Sequence[float] = (0.0, 0.0, 0.0),
    extent: Sequence[float] = CAR_EXTENT,
    attributes: Mapping[str, str] | None = None,
) -> ActorInfo:
    """An actor with an axis-aligned box."""
    return ActorInfo(
        id=actor_id,
        type_id=type_id,
        parent=0,
        attributes={"base_type": "car"} if attributes is None else attributes,
        semantic_tags=(CAR_TAG,),
        box_location=np.array(location, dtype=np.float64),
        box_extent=np.array(extent, dtype=np.float64),
        box_rotation_deg=np.zeros(3),
    )


def snapshot(
    poses: Mapping[int, tuple[Sequence[float], Sequence[float]]], tick: int = 4, **meta: Any
) -> WorldFrame:
    """A snapshot of actors by id: location and rotation; the ego stands far behind the camera."""
    placed = {EGO_ID: ((-50.0, 0.0, 0.0), (0.0, 0.0, 0.0)), **poses}
    ids = sorted(placed)
    count = len(ids)
    return WorldFrame(
        tick=tick,
        frame=100 + tick,
        timestamp_s=3.0,
        actor_id=np.array(ids, dtype=np.uint32),
        location=np.array([placed[i][0] for i in ids], dtype=np.float64),
        rotation_deg=np.array([placed[i][1] for i in ids], dtype=np.float64),
        velocity=np.tile([1.0, 2.0, 0.0], (count, 1)),
        angular_velocity_deg=np.tile([0.0, 0.0, 57.29578], (count, 1)),
        acceleration=np.tile([0.5, 0.0, 0.0], (count, 1)),
        meta=meta,
    )


def header(
    *,
    width: int = 640,
    height: int = 360,
    labels: Mapping[str, Any] | None = None,
    lidar: bool = False,
    cameras: Sequence[str] = ("CAM",),
    mount: Mapping[str, float] | None = None,
    sensor_actor_ids: Mapping[str, int] | None = None,
    **spec: Any,
) -> dict[str, Any]:
    """A raw log's ``episode.json``; by default the sensors stand at the world's origin."""
    pose = {"x_m": 50.0} if mount is None else mount
    size = {"image_size_x": str(width), "image_size_y": str(height), "fov": "90.0"}
    sensors = [
        bare_sensor(
            name,
            "rgb",
            labelled=True,
            pose=pose,
            attributes=size,
            depth=f"{name}.depth",
            instance=f"{name}.instance",
        )
        for name in cameras
    ]
    if lidar:
        sensors += [
            bare_sensor("TOP", "lidar", pose=pose),
            bare_sensor("RADAR", "radar", pose=pose),
        ]
    return {
        "episode_id": "abc",
        "server_version": "0.9.16",
        "map": "Carla/Maps/Stage01",
        "geo_reference": {"latitude_deg": 0.0, "longitude_deg": 0.0},
        "ego_id": EGO_ID,
        "first_timestamp_s": 2.25,
        "sensor_actor_ids": sensor_actor_ids or {},
        "spec": bare_spec(sensors, labels=dict(labels or {}), **spec),
    }


def labeller(*actors: ActorInfo, **options: Any) -> EpisodeLabeller:
    """A labeller of an episode with an ego and these actors; options as in ``header``."""
    known = {info.id: info for info in (actor(EGO_ID), *actors)}
    return EpisodeLabeller(header(**options), known)


def box_interval(
    view: BoxView, k: FloatArray, z_near_m: float = Z_NEAR_M
) -> tuple[FloatArray, FloatArray]:
    """Z-depths at which rays enter and leave the inflated box, for every pixel of the region.

    The slab test as the kernel does it, in plain numpy; a ray misses where enter > leave.
    """
    x0, y0, x1, y1 = view.region
    x = (np.arange(x0, x1) + 0.5 - k[0, 2]) / k[0, 0]
    y = (np.arange(y0, y1) + 0.5 - k[1, 2]) / k[1, 1]
    enter, leave = np.full((len(y), len(x)), z_near_m), np.full((len(y), len(x)), np.inf)
    half = view.extent_m + BOX_MARGIN_M
    for axis in range(3):
        a, b, c = view.box_from_optical[axis]
        direction = (a * x)[None, :] + (b * y + c)[:, None]
        inverse = 1.0 / np.where(direction == 0.0, 1e-300, direction)
        low = inverse * (-half[axis] - view.origin_box[axis])
        high = inverse * (half[axis] - view.origin_box[axis])
        enter = np.maximum(enter, np.minimum(low, high))
        leave = np.minimum(leave, np.maximum(low, high))
    return enter, leave


class PaintedImages:
    """A depth and an instance image, painted solid by solid, nearest first.

    The camera stands at the world's origin and looks along +x; its field of view is 90 degrees.
    """

    def __init__(self, width: int = 640, height: int = 360) -> None:
        self.depth: NDArray[np.float64] = np.full((height, width), FAR_M)
        self.bgra: NDArray[np.uint8] = np.zeros((height, width, 4), dtype=np.uint8)
        focal = width / 2
        y = (np.arange(width) + 0.5 - width / 2) / focal
        z = -(np.arange(height) + 0.5 - height / 2) / focal
        # World directions with x = 1: the parameter along the ray is the z-depth.
        self.rays = np.stack(np.broadcast_arrays(1.0, y[None, :], z[:, None]), axis=-1)

    def images(self) -> CameraImages:
        return CameraImages(self.depth.astype(np.float32), self.bgra)

    def paint(self, where: NDArray[np.bool_], depth: Any, actor_id: int, tag: int) -> None:
        """Put a surface where it is nearer than what is there."""
        depth = np.broadcast_to(depth, self.depth.shape)
        nearer = where & (depth < self.depth)
        self.depth[nearer] = depth[nearer]
        self.bgra[nearer] = (actor_id >> 8 & 0xFF, actor_id & 0xFF, tag, 255)

    def _local(
        self, center: Sequence[float], yaw_deg: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rotation = rotation_matrix([0.0, yaw_deg, 0.0])
        return rotation.T @ -np.asarray(center, dtype=np.float64), self.rays @ rotation

    def paint_box(
        self,
        center: Sequence[float],
        extent: Sequence[float],
        actor_id: int,
        tag: int = CAR_TAG,
        yaw_deg: float = 0.0,
    ) -> None:
        """A solid box: each of its faces is a piece of a plane."""
        origin, rays = self._local(center, yaw_deg)
        for axis in range(3):
            for side in (-extent[axis], extent[axis]):
                with np.errstate(divide="ignore", invalid="ignore"):
                    t = (side - origin[axis]) / rays[..., axis]
                    point = origin + t[..., None] * rays
                others = [other for other in range(3) if other != axis]
                on_face = np.all(
                    [np.abs(point[..., other]) <= extent[other] for other in others], axis=0
                )
                self.paint(on_face & (t > 0.0), t, actor_id, tag)

    def paint_cylinder(
        self, center: Sequence[float], radius: float, half_height: float, actor_id: int, tag: int
    ) -> None:
        """An upright cylinder without lids."""
        origin, rays = self._local(center, 0.0)
        a = (rays[..., :2] ** 2).sum(axis=-1)
        b = (rays[..., :2] * origin[:2]).sum(axis=-1)
        c = float((origin[:2] ** 2).sum()) - radius**2
        discriminant = b * b - a * c
        t = (-b - np.sqrt(np.maximum(discriminant, 0.0))) / a
        height = origin[2] + t * rays[..., 2]
        hit = (discriminant >= 0.0) & (np.abs(height) <= half_height)
        self.paint(hit & (t > 0.0), t, actor_id, tag)
