"""Voxels of datasets: what of depth images they explain, and what they cost.

Depth images are brought into the world by ``carla.Transform``, and SciPy looks for the nearest
occupied voxel of each pixel. Boxes are those of ``carla.BoundingBox``. The datasets have depth,
instance pictures and semantic LiDARs, so that the files can be made again from them. What is seen
of a built-in town is compared with its meshes, which trimesh makes voxels of.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import carla
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.framework.town_voxels import TownVoxels
from carstage import Dataset
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage.birds_eye import CameraView, Cloud
from carstage.codecs.semantic_points import points_xyz
from carstage.dataset import Episode, Frame
from carstage.occupancy import (
    Occupancy,
    Picture,
    Placer,
    Sweep,
    VoxelGrid,
    pack_occupancy,
)
from carstage.occupancy.gathering import Gathering
from carstage.processes.worker import keep_memory
from carstage.sensor_kinds.columns import Instance
from carstage.sensor_kinds.model import CLOUDS
from carstage.spec.sensors import EGO
from carstage.tags import TAGS_0_9_14

TARGET_EXPLAINED = 0.97
TARGET_CPU_MS = 40.0
TARGET_IOU = 0.85
TARGET_CLASS_IOU = 0.7
_FAR_M = 999.0
_PIXELS = 20_000
"""Of a depth image that are looked up, drawn at random."""


def measure_occupancy(
    datasets: Sequence[Path],
    near_m: float = 8.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Compare voxels with depth images, boxes and meshes, and make them again.

    Args:
        datasets: with voxels around the ego, each of one built-in town.
        near_m: how far around the ego the middle frame of each episode is compared with meshes.
        progress: called with the frames done and their number.

    Raises:
        ValueError: a dataset has no voxels.
    """
    keep_memory()
    episodes = [episode for path in datasets for episode in Dataset(path).episodes]
    total = sum(episode.frames for episode in episodes)
    slow, spent_ms, sizes = [slowness()], list[float](), list[int]()
    towns: dict[str, TownVoxels] = {}
    near = pixels = inside = of_boxes = otherwise = frames = 0
    rng = np.random.default_rng(0)
    for episode in episodes:
        if episode.spec.labels.occupancy is None:
            raise ValueError(f"Episode {episode.id} has no voxels.")
        if episode.spec.map not in towns:
            towns[episode.spec.map] = TownVoxels(episode.spec.map, near_m)
        town = towns[episode.spec.map]
        made, cost_ms = made_again(episode)
        spent_ms += cost_ms
        for frame in episode.iter_frames():
            stored = episode.occupancy(frame.k)
            assert stored is not None
            if frame.k == episode.frames // 2:
                town.add(stored)
            packed = pack_occupancy(stored)
            sizes.append(len(packed))
            otherwise += packed != made[frame.k]
            for points in depth_points(frame, rng):
                found = explained(frame, stored, points)
                near, pixels = near + int(found.sum()), pixels + len(found)
            right, count = in_boxes(frame, stored)
            inside, of_boxes, frames = inside + right, of_boxes + count, frames + 1
            progress(frames, total)
        slow.append(slowness())
    ious = [town.ious() for town in towns.values()]
    by_class = [
        Figure(f"iou_of_{TAGS_0_9_14[int(tag)].name.lower()}_in_{name}", iou)
        for name, (_, classes) in zip(towns, ious, strict=True)
        for tag, iou in sorted(classes.items())
    ]
    scale = max(1.0, statistics.median(slow))
    cpu_ms = statistics.median(spent_ms)
    figures = (
        Figure("frames", frames),
        Figure("depth_pixels", pixels),
        Figure("share_of_depth_pixels_explained", near / max(pixels, 1), ">=", TARGET_EXPLAINED),
        Figure("voxels_of_road_users", of_boxes),
        Figure("share_of_them_in_their_boxes", inside / max(of_boxes, 1), ">=", 1.0),
        Figure("frames_made_otherwise_from_the_dataset", otherwise, "<=", 0),
        Figure("iou_of_what_is_occupied", min(one for one, _ in ious), ">=", TARGET_IOU),
        Figure(
            "mean_iou_of_classes",
            min(statistics.mean(classes.values()) for _, classes in ious),
            ">=",
            TARGET_CLASS_IOU,
        ),
        *by_class,
        Figure("machine_slowness", scale),
        Figure("cpu_ms_per_frame", cpu_ms),
        Figure("scaled_cpu_ms_per_frame", cpu_ms / scale, "<=", TARGET_CPU_MS),
        Figure("kilobytes_per_frame", statistics.mean(sizes) / 1000.0),
    )
    notes = (
        "The cost is that of gathering, placing and packing; reading and writing not included.",
        "Memory is kept between frames, as the conversion's processes keep it.",
        "A pixel is explained if the centre of an occupied voxel is within a voxel's diagonal.",
        "Surfaces on the ego are left out, as its voxels are.",
        f"Meshes: voxels of the middle frame within {near_m:g} m that a sensor of the frame sees.",
        "Road users and parked vehicles are left out there.",
    )
    return Verdict("occupancy", figures, notes)


def made_again(episode: Episode) -> tuple[dict[int, bytes], list[float]]:
    """The files of an episode by frame, and CPU milliseconds for each frame."""
    asked = episode.spec.labels.occupancy
    assert asked is not None
    grid = VoxelGrid.of(asked)
    gathering, masks, spent = Gathering(grid), {}, {}
    for frame in episode.iter_frames():
        seen, rows = list(seen_by(frame)), object_rows(frame)
        pose = frame_pose(frame, asked.frame)
        started = time.process_time()
        masks[frame.k] = gathering.add(pose, rows, seen)
        spent[frame.k] = time.process_time() - started
    started = time.process_time()
    placer = Placer(grid, gathering.end())
    together = (time.process_time() - started) / max(episode.frames, 1)
    made = {}
    for frame in episode.iter_frames():
        pose, rows = frame_pose(frame, asked.frame), object_rows(frame)
        started = time.process_time()
        voxels = placer.place(pose, rows)
        made[frame.k] = pack_occupancy(Occupancy(grid, pose, voxels, masks[frame.k]))
        spent[frame.k] += together + time.process_time() - started
    return made, [1e3 * seconds for seconds in spent.values()]


def seen_by(frame: Frame) -> Iterator[Picture | Sweep]:
    """What cameras and LiDARs of a frame saw."""
    for sensor in frame.episode.sensors:
        camera = sensor.calibration
        if camera.labelled and camera.depth is not None and camera.instance is not None:
            size = camera.width, camera.height
            pose = frame.world_from_sensor(sensor.id)
            shown = frame.read(camera.instance)[..., Instance.TAG].astype(np.uint8)
            yield Picture(CameraView(camera.k, pose, frame.read(camera.depth), *size), shown)
    for sensor in frame.episode.sensors:
        if sensor.content in CLOUDS:
            points = frame.read(sensor.id)
            tagged = points.dtype.names is not None
            tags = points["object_tag"].astype(np.uint8) if tagged else None
            yield Sweep(Cloud(frame.world_from_sensor(sensor.id), points_xyz(points)), tags)


def frame_pose(frame: Frame, name: str) -> NDArray[np.float64]:
    """``(4, 4)`` pose of the ego or a sensor."""
    return frame.world_from_ego if name == EGO else frame.world_from_sensor(name)


def object_rows(frame: Frame) -> list[Mapping[str, Any]]:
    """Rows of ``objects.parquet``, the ego's too."""
    return [*frame.objects.values(), *([frame.ego_object] if frame.ego_object else [])]


def depth_points(frame: Frame, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """``(N, 3)`` places in the world that pixels of depth images show."""
    for sensor in frame.episode.sensors:
        camera = sensor.calibration
        if not (camera.labelled and camera.depth is not None):
            continue
        depth = frame.read(camera.depth).astype(np.float64).ravel()
        chosen = rng.choice(len(depth), min(_PIXELS, len(depth)), replace=False)
        row, column = np.divmod(chosen, camera.width)
        along = depth[chosen]
        right = (column + 0.5 - camera.width / 2.0) / camera.k[0, 0] * along
        down = (row + 0.5 - camera.height / 2.0) / camera.k[1, 1] * along
        pose = frame.sensor_poses[sensor.id]
        matrix = np.array(_transform(pose["location"], pose["rotation_deg"]).get_matrix())
        local = np.stack([along, right, -down, np.ones_like(along)], axis=-1)[along < _FAR_M]
        yield (local @ matrix.T)[:, :3]


def _transform(location: Sequence[float], rotation_deg: Sequence[float]) -> carla.Transform:
    return carla.Transform(carla.Location(*location), carla.Rotation(*rotation_deg))


def explained(frame: Frame, stored: Occupancy, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Of the points within the voxels and not on the ego, which have an occupied one near."""
    frame_from_world = np.linalg.inv(stored.world_from_frame)
    local = np.c_[points, np.ones(len(points))] @ frame_from_world[:3].T * [1.0, -1.0, 1.0]
    low = np.array(stored.grid.low_m)
    high = low + np.array(stored.grid.shape) * stored.grid.side_m
    kept = ((local >= low) & (local < high)).all(axis=1)
    if frame.ego_object is not None:
        kept &= ~_within(frame.ego_object, points, 0.3)
    centres = stored.centres()[stored.occupied]
    reach = stored.grid.side_m * np.sqrt(3.0)
    distance, _ = KDTree(centres).query(local[kept], distance_upper_bound=reach)
    return np.asarray(np.isfinite(distance))


def _within(row: Mapping[str, Any], points: NDArray[Any], reach_m: float) -> NDArray[np.bool_]:
    inverse = np.array(_transform(row["box_center"], row["box_rotation_deg"]).get_inverse_matrix())
    local = (np.c_[points, np.ones(len(points))] @ inverse.T)[:, :3]
    return np.asarray((np.abs(local) <= np.array(row["box_extent"]) + reach_m).all(axis=1))


def in_boxes(frame: Frame, stored: Occupancy) -> tuple[int, int]:
    """How many voxels of road users touch their box, grown by its reach; and how many there are."""
    right = count = 0
    world = stored.centres().reshape(-1, 3) * [1.0, -1.0, 1.0]
    tracks = stored.tracks.ravel()
    for track in stored.voxels.track_id.tolist():
        own = world[tracks == track]
        places = (np.c_[own, np.ones(len(own))] @ stored.world_from_frame.T)[:, :3]
        row = frame.objects[track]
        reach = 0.5 if row["class"].startswith("walker") else 0.3
        within = _within(row, places, reach + stored.grid.side_m * np.sqrt(3.0) / 2.0 + 1e-3)
        right, count = right + int(within.sum()), count + len(own)
    return right, count
