"""What labelling one frame costs: a hundred objects before one 1280x720 camera.

A dense crowd that is made up, from the same numbers each time: vehicles and pedestrians in several
rows, each turned its own way, with a depth and an instance picture of them. The labeller is the one
that converters use; CPU time of its process is scaled by a calibration kernel.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.annotation import CameraImages, EpisodeLabeller
from carstage.bench.calibration import slowness
from carstage.bench.episodes import Progress
from carstage.bench.verdict import Figure, Verdict
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    FloatArray,
    intrinsics,
    pose_matrix,
)
from carstage.rawlog.reader import ActorInfo, WorldFrame

ACTORS: Final = 100
HULL_PX: Final = 1_500_000
TARGET_STAGE_VO_MS: Final = 6.0
TARGET_PIXELS_MS: Final = 40.0
_SIZE: Final = (1280, 720)
_FOV_DEG: Final = 90.0
_EGO_ID: Final = 1
_ROAD_TAG: Final = 1
_EYE_M: Final = 4.5
_NEAREST_M, _FARTHEST_M = 7.5, 75.0
_CAMERA: Final = "CAM"

# Blueprint, class attribute, tag, half extents (m); drawn in turn.
_ACTOR_TYPES: Final = (
    ("vehicle.tesla.model3", "car", 14, (2.40, 1.08, 0.74)),
    ("vehicle.carlamotors.carlacola", "truck", 15, (2.60, 1.31, 1.23)),
    ("walker.pedestrian.0001", "", 12, (0.19, 0.19, 0.93)),
    ("vehicle.ford.ambulance", "van", 14, (3.18, 1.18, 1.22)),
    ("vehicle.yamaha.yzf", "motorcycle", 18, (1.10, 0.43, 0.83)),
)
_SOLID: Final = 0.93
"""Share of its box that each solid fills, along each axis."""


def measure_annotation(
    *, frames: int = 30, progress: Progress = lambda done, total: None
) -> Verdict:
    """Label the same frame again and again by either method.

    Args:
        frames: how often, by each method.
        progress: called with the frames done and their total number.
    """
    crowd = Crowd()
    images = {_CAMERA: crowd.pictures()}
    slow: list[float] = []
    cpu_ms: dict[str, float] = {}
    hull_px = objects = 0
    for number, method in enumerate(("stage_vo", "pixels")):
        slow.append(slowness())
        labeller = crowd.labeller(method)
        spent = []
        for frame in range(frames):
            started = time.process_time()
            labels = labeller.label_frame(crowd.world, frame, images, {})
            spent.append(1e3 * (time.process_time() - started))
            progress(number * frames + frame + 1, 2 * frames)
        cpu_ms[method] = statistics.median(spent)
        objects = len(labels.camera_objects)
        hull_px = sum(row["hull_px"] or 0 for row in labels.camera_objects)
    return judge(cpu_ms, objects, hull_px, max(1.0, statistics.median(slow)))


def judge(cpu_ms: Mapping[str, float], objects: int, hull_px: int, slow: float) -> Verdict:
    """The figures of CPU times that were taken on a machine ``slow`` times slower than planned."""
    return Verdict(
        "annotation",
        (
            Figure("machine_slowness", slow),
            Figure("objects_in_the_picture", objects, ">=", ACTORS),
            Figure("hull_pixels", hull_px, ">=", HULL_PX),
            Figure("stage_vo_cpu_ms", cpu_ms["stage_vo"]),
            Figure("scaled_stage_vo_cpu_ms", cpu_ms["stage_vo"] / slow, "<=", TARGET_STAGE_VO_MS),
            Figure("pixels_cpu_ms", cpu_ms["pixels"]),
            Figure("scaled_pixels_cpu_ms", cpu_ms["pixels"] / slow, "<=", TARGET_PIXELS_MS),
        ),
        (
            "One camera of 1280x720; all tables of a frame, with boxes and masks; decoding of the "
            "instance picture included, reading and writing not.",
        ),
    )


class Crowd:
    """A hundred objects before a camera at the origin, 4.5 m above a plain."""

    def __init__(self) -> None:
        rng = np.random.default_rng(5)
        distance = _NEAREST_M * (_FARTHEST_M / _NEAREST_M) ** (np.arange(ACTORS) / (ACTORS - 1))
        bearing = np.radians(rng.permutation(np.linspace(-40.0, 40.0, ACTORS)))
        self._ids = np.arange(ACTORS, dtype=np.uint32) + 100
        self._types = [_ACTOR_TYPES[number % len(_ACTOR_TYPES)] for number in range(ACTORS)]
        self._extent = np.array([extent for *_, extent in self._types])
        is_walker = np.array([name.startswith("walker") for name, *_ in self._types])
        pivot_z = np.where(is_walker, self._extent[:, 2], 0.0) - _EYE_M
        location = np.stack(
            [distance * np.cos(bearing), distance * np.sin(bearing), pivot_z], axis=-1
        )
        rotation = np.zeros((ACTORS, 3))
        rotation[:, 1] = rng.uniform(-180.0, 180.0, ACTORS)
        self._box_location = np.zeros((ACTORS, 3))
        self._box_location[:, 2] = np.where(is_walker, 0.0, self._extent[:, 2])
        self._world_from_box = pose_matrix(location, rotation)
        self._world_from_box[:, :3, 3] += self._box_location  # upright: no rotation to apply
        self.world = _snapshot(self._ids, location, rotation)

    def labeller(self, method: str) -> EpisodeLabeller:
        """A labeller of this scene by ``stage_vo`` or ``pixels``."""
        actors = {_EGO_ID: _actor(_EGO_ID, _ACTOR_TYPES[0], np.zeros(3))}
        for actor_id, one, location in zip(
            self._ids.tolist(), self._types, self._box_location, strict=True
        ):
            actors[actor_id] = _actor(actor_id, one, location)
        return EpisodeLabeller(_header(method), actors)

    def pictures(self) -> CameraImages:
        """What the camera sees: solids in the boxes, nearest first, on a plain."""
        width, height = _SIZE
        k = intrinsics(width, height, _FOV_DEG)
        x = (np.arange(width) + 0.5 - k[0, 2]) / k[0, 0]
        y = (np.arange(height) + 0.5 - k[1, 2]) / k[1, 1]
        rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), axis=-1)
        with np.errstate(divide="ignore"):
            depth = np.where(y > 0.0, _EYE_M / y, 1000.0).clip(max=1000.0)[:, None]
        depth = np.broadcast_to(depth, (height, width)).copy()
        bgra = np.zeros((height, width, 4), dtype=np.uint8)
        bgra[..., 2] = np.where(depth < 1000.0, _ROAD_TAG, 0)
        for actor_id, one, pose, extent in zip(
            self._ids.tolist(), self._types, self._world_from_box, self._extent, strict=True
        ):
            window = _window(k, pose, _SOLID * extent)
            enter = _entry(rays[window], pose, _SOLID * extent)
            nearer = enter < depth[window]
            depth[window][nearer] = enter[nearer]
            bgra[window][nearer] = (actor_id >> 8 & 0xFF, actor_id & 0xFF, one[2], 255)
        return CameraImages(depth.astype(np.float32), bgra)


def _window(k: FloatArray, world_from_box: FloatArray, extent: FloatArray) -> tuple[slice, slice]:
    """Rows and columns that a box before the camera may be seen in; all if it reaches behind."""
    signs = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, -1).T
    corners = signs * extent @ world_from_box[:3, :3].T + world_from_box[:3, 3]
    at = corners @ OPTICAL_FROM_SENSOR[:3, :3].T @ k.T
    if at[:, 2].min() <= 0.0:
        return slice(None), slice(None)
    pixels = at[:, :2] / at[:, 2:]
    (left, top), (right, bottom) = pixels.min(0), pixels.max(0)
    rows, columns = (
        slice(max(0, int(low) - 1), max(0, int(high) + 2))
        for low, high in ((top, bottom), (left, right))
    )
    return rows, columns


def _entry(rays_optical: FloatArray, world_from_box: FloatArray, extent: FloatArray) -> FloatArray:
    """``(H, W)`` z-depth at which rays from the origin meet a box, infinite where they miss."""
    rotation = world_from_box[:3, :3]
    origin = rotation.T @ -world_from_box[:3, 3]
    direction = rays_optical @ (rotation.T @ OPTICAL_FROM_SENSOR.T).T
    with np.errstate(divide="ignore"):
        low, high = (-extent - origin) / direction, (extent - origin) / direction
    enter = np.minimum(low, high).max(axis=-1)
    leave = np.maximum(low, high).min(axis=-1)
    return np.where((enter <= leave) & (enter > 0.0), enter, np.inf)


def _actor(actor_id: int, one: tuple[Any, ...], box_location: FloatArray) -> ActorInfo:
    type_id, base_type, tag, extent = one
    return ActorInfo(
        id=actor_id,
        type_id=type_id,
        parent=0,
        attributes={"base_type": base_type},
        semantic_tags=(tag,),
        box_location=box_location,
        box_extent=np.array(extent),
        box_rotation_deg=np.zeros(3),
    )


def _snapshot(
    ids: NDArray[np.uint32], location: FloatArray, rotation_deg: FloatArray
) -> WorldFrame:
    """The crowd and the ego, which carries the camera and stands at the origin."""

    def with_ego(values: FloatArray) -> FloatArray:
        return np.concatenate([np.zeros((1, 3)), values])

    still = np.zeros((len(ids) + 1, 3))
    return WorldFrame(
        tick=0,
        frame=1,
        timestamp_s=0.0,
        actor_id=np.concatenate([np.array([_EGO_ID], dtype=np.uint32), ids]),
        location=with_ego(location),
        rotation_deg=with_ego(rotation_deg),
        velocity=still,
        angular_velocity_deg=still,
        acceleration=still,
        meta={},
    )


def _header(method: str) -> dict[str, Any]:
    width, height = _SIZE
    camera = bare_sensor(
        _CAMERA,
        "rgb",
        labelled=True,
        attributes={
            "image_size_x": str(width),
            "image_size_y": str(height),
            "fov": str(_FOV_DEG),
        },
        depth="CAM.depth",
        instance="CAM.instance",
    )
    return {
        "episode_id": "crowd",
        "server_version": "0.9.16",
        "map": "crowd",
        "geo_reference": {"latitude_deg": 0.0, "longitude_deg": 0.0, "altitude_m": 0.0},
        "ego_id": _EGO_ID,
        "first_timestamp_s": 0.0,
        "sensor_actor_ids": {},
        "spec": bare_spec([camera], labels={"method": method}, ground_truth={"ego_motion": False}),
    }
