"""Exact voxels of datasets: beside trimesh's, depth images and boxes; what they cost.

Each frame's scene is put together again in this process: the town, and vehicles at the places of
the label tables. Pedestrians, whose steps no table has, are left out of the comparison with meshes.
The same dataset's pictures and sweeps give the voxels of the other way, which are compared, too.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.mesh_voxels import MeshVoxels, Surfaces, joined
from benchmarks.framework.occupancy import (
    TARGET_CPU_MS,
    TARGET_EXPLAINED,
    depth_points,
    explained,
    frame_pose,
    in_boxes,
    made_again,
    object_rows,
    seen_by,
)
from carstage import Dataset
from carstage.annotation.tracks import FIRST_RIDER
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Frame
from carstage.occupancy import (
    Occupancy,
    Sweep,
    VoxelGrid,
    exact_voxels,
    grid_from_world,
    pack_occupancy,
    seen_voxels,
    surface,
    unpack_occupancy,
)
from carstage.processes.worker import keep_memory
from carstage.spec import OccupancySpec
from carstage.tags import TAGS_0_9_14
from carstage_sim.cache import cache_folder
from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps import MapCatalogue
from carstage_sim.render.scene import Frame as SceneFrame
from carstage_sim.render.scene import Placement, SceneStore
from carstage_sim.sensors.actors import ActorModels
from carstage_sim.sensors.occupancy import VoxelScan

TARGET_IOU = 0.98
_PEDESTRIAN = 12


class Scenes:
    """The scenes of a built-in town.

    Args:
        name: of the town.
    """

    def __init__(self, name: str) -> None:
        town = MapCatalogue().load(name)
        self._models = ActorModels(town, cache=cache_folder() / "meshes")
        self._store = SceneStore(
            town.static_mesh, self._models.mesh, cache=None, beside=self._models.beside
        )
        mesh = town.static_mesh
        self._town = Surfaces(mesh.vertices.astype(np.float64)[mesh.triangles], mesh.tag)
        heads = [site.head for site in town.traffic_lights]
        self._lights = [
            self._placed(0, f"traffic_light#{heads.index(s.head)}", s.location, s.rotation_deg)
            for s in town.traffic_lights
        ]

    def frame(self, rows: Sequence[Mapping[str, Any]]) -> SceneFrame:
        """The scene of rows of ``objects.parquet``."""
        found = [*self._lights]
        for row in rows:
            keys = self._models.keys_of(row["blueprint"] or "")
            if keys and row["track_id"] < FIRST_RIDER:
                place, turn = row["actor_location"], row["actor_rotation_deg"]
                found.append(self._placed(row["track_id"], keys[0], place, turn))
        return self._store.frame(found)

    def surfaces(self, frame: SceneFrame, left_out: Sequence[int]) -> Surfaces:
        """The triangles of a scene, without those of some actors."""
        parts = [self._town]
        for row, shape in enumerate(frame.shapes):
            if int(frame.actor_id[row]) not in left_out:
                turned = shape.corners.astype(np.float64) @ frame.scene.rotation[row].T
                tags = frame.actors.tag[shape.first : shape.first + len(turned)]
                parts.append(Surfaces(turned + frame.scene.position[row], tags))
        return joined(parts)

    @staticmethod
    def _placed(
        actor_id: int, model: str, location: Sequence[float], rotation_deg: Sequence[float]
    ) -> Placement:
        pitch, yaw, roll = rotation_deg
        turn = rotation_matrix((pitch, yaw, roll)).reshape(3, 3)
        return Placement(actor_id, model, np.array(location, np.float64), turn)


class _Agreement:
    """Adds up how two ways agree."""

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros((2, 3), np.int64)

    def add(self, exact: Occupancy, gathered: Occupancy) -> None:
        """A frame's voxels, the same of both."""
        for row, kept in enumerate((np.ones(exact.grid.shape, np.bool_), exact.seen > 0)):
            one, other = exact.occupied[kept], gathered.occupied[kept]
            both = one & other
            same = both & (exact.semantic[kept] == gathered.semantic[kept])
            self._counts[row] += [(one | other).sum(), both.sum(), same.sum()]

    def figures(self) -> Iterator[Figure]:
        """Of all voxels, and of those that a sensor of the frame sees."""
        for row, place in enumerate(("", "_where_seen")):
            either, both, same = self._counts[row].tolist()
            yield Figure(f"iou_of_both_ways{place}", both / max(either, 1))
            yield Figure(f"same_class_of_both_ways{place}", same / max(both, 1))


def measure_exact_occupancy(
    datasets: Sequence[Path],
    near_m: float = 8.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Compare exact voxels with meshes, depth images, boxes and the other way's.

    Args:
        datasets: with exact voxels around the ego, depth, instances and semantic LiDARs.
        near_m: how far around the ego the middle frame of each episode is compared with meshes.
        progress: called with the frames done and their number.

    Raises:
        ValueError: a dataset has no exact voxels.
    """
    keep_memory()
    episodes = [episode for path in datasets for episode in Dataset(path).episodes]
    total = sum(episode.frames for episode in episodes)
    slow, sizes, rng = list[float](), list[int](), np.random.default_rng(0)
    costs = list[tuple[float, float]]()
    meshes, agreement = MeshVoxels(near_m), _Agreement()
    near = pixels = inside = of_boxes = frames = 0
    for episode in episodes:
        asked = episode.spec.labels.occupancy
        if asked is None or not asked.exact:
            raise ValueError(f"Episode {episode.id} has no exact voxels.")
        scenes = Scenes(episode.spec.map)
        gathered, _ = made_again(episode)
        for frame in episode.iter_frames():
            stored = episode.occupancy(frame.k)
            assert stored is not None
            scene = scenes.frame(object_rows(frame))
            costs.append(_cost(frame, scene))
            slow.append(slowness())
            sizes.append(len(pack_occupancy(stored)))
            agreement.add(stored, unpack_occupancy(gathered[frame.k]))
            if frame.k == episode.frames // 2:
                _compare(meshes, scenes, frame, scene, stored)
            for points in depth_points(frame, rng):
                found = explained(frame, stored, points)
                near, pixels = near + int(found.sum()), pixels + len(found)
            right, count = in_boxes(frame, stored)
            inside, of_boxes, frames = inside + right, of_boxes + count, frames + 1
            progress(frames, total)
    occupied, classes = meshes.ious()
    scale = max(1.0, statistics.median(slow))
    scan_ms, label_ms = (statistics.median(column) for column in zip(*costs, strict=True))
    figures = (
        Figure("frames", frames),
        Figure("depth_pixels", pixels),
        Figure("share_of_depth_pixels_explained", near / max(pixels, 1), ">=", TARGET_EXPLAINED),
        Figure("voxels_of_road_users", of_boxes),
        Figure("share_of_them_in_their_boxes", inside / max(of_boxes, 1), ">=", 1.0),
        Figure("iou_of_what_is_occupied", occupied, ">=", TARGET_IOU),
        *(
            Figure(f"iou_of_{TAGS_0_9_14[tag].name.lower()}", iou, ">=", TARGET_IOU)
            for tag, iou in sorted(classes.items())
        ),
        *agreement.figures(),
        Figure("machine_slowness", scale),
        Figure("simulator_cpu_ms_per_frame", scan_ms),
        Figure("label_cpu_ms_per_frame", label_ms),
        Figure("scaled_cpu_ms_per_frame", (scan_ms + label_ms) / scale, "<=", TARGET_CPU_MS),
        Figure("kilobytes_per_frame", statistics.mean(sizes) / 1000.0),
    )
    notes = (
        "The cost is that of 200 x 200 x 16 voxels of 0.4 m: finding them in the simulator, and "
        "their labels with masks and packing. Carrying, reading and writing are not included.",
        f"Meshes: all voxels of the middle frame within {near_m:g} m, seen or not. Pedestrians "
        "are left out there.",
        "The other way's voxels are gathered from pictures and sweeps of the same dataset.",
    )
    return Verdict("exact-occupancy", figures, notes)


def _compare(
    meshes: MeshVoxels, scenes: Scenes, frame: Frame, scene: SceneFrame, stored: Occupancy
) -> None:
    """A frame's voxels with the scene's triangles; the ego is in neither."""
    rows = object_rows(frame)
    walkers = [row["track_id"] for row in rows if row["class"].startswith("walker")]
    gone = [*walkers, *(row["track_id"] for row in rows if row["is_ego"])]
    left_out = np.isin(stored.tracks, walkers)
    meshes.add(stored, scenes.surfaces(scene, gone), left_out)


def _cost(frame: Frame, scene: SceneFrame) -> tuple[float, float]:
    """CPU milliseconds in the simulator and for the labels of a frame, at the usual size."""
    grid = VoxelGrid.of(OccupancySpec())
    pose, rows = frame_pose(frame, "ego"), object_rows(frame)
    # Exact voxels need no semantic twin of a LiDAR, which the other way takes its classes from.
    seen = [one for one in seen_by(frame) if not isinstance(one, Sweep) or one.tags is None]
    x, y, z = pose[:3, 3].tolist()
    scan = VoxelScan(np.array(grid.low_m), grid.shape, grid.side_m)
    scan.points(scene, (x, y, z), pose[:3, :3])  # memory is there from the first frame on
    started = time.process_time()
    points = scan.points(scene, (x, y, z), pose[:3, :3])
    found = time.process_time()
    matrix = grid_from_world(pose)
    swept = [surface(grid, matrix, one) if isinstance(one, Sweep) else None for one in seen]
    mask = seen_voxels(grid, matrix, seen, swept)
    pack_occupancy(Occupancy(grid, pose, exact_voxels(grid, pose, rows, points), mask))
    return 1e3 * (found - started), 1e3 * (time.process_time() - found)
