"""Whether voxels agree with the boxes and sensors of their frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye import CameraView, Cloud
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.reading import Episode
from carstage.dataset.saved_frames import RowsByFrame
from carstage.geometry import FloatArray, invert_pose, pose_matrix
from carstage.occupancy import (
    FREE,
    MOVABLE_TAGS,
    Occupancy,
    Picture,
    Surface,
    Sweep,
    VoxelGrid,
    box_tags,
    grid_from_world,
    occupancy_name,
    seen_voxels,
    surface,
    unpack_occupancy,
)
from carstage.occupancy.gathering import grid_points
from carstage.occupancy.grid import placed
from carstage.occupancy.objects import RoadUser, owners, road_users
from carstage.occupancy.placing import motion
from carstage.sensor_kinds.model import CLOUDS, TAGGED_POINTS
from carstage.spec import EpisodeSpec
from carstage.spec.sensors import EGO
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.files import VerifiedFiles
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

LEAST_EXPLAINED = 0.97
"""Share of a sensor's surface that lies in an occupied voxel or beside one."""
_FEW_POINTS = 200
_POSE_TOLERANCE = 1e-3
_OBJECT_COLUMNS = [
    "k", "track_id", "class", "is_ego", "box_center", "box_rotation_deg", "box_extent", "velocity",
    "angular_velocity", "actor_location", "actor_rotation_deg",
]  # fmt: skip


class OccupancyChecks:
    """Compares the voxels of an episode with its labels and sensors, frame after frame.

    Args:
        episode: the episode.
        tables: its label tables.
        files: reads and verifies the voxels' files.
        findings: check ``occupancy``.
    """

    def __init__(
        self, episode: Episode, tables: LabelTables, files: VerifiedFiles, findings: Findings
    ) -> None:
        self._asked = episode.spec.labels.occupancy
        self._files, self._findings = files, findings
        if self._asked is None:
            return
        self._objects = RowsByFrame(tables.objects.select(_OBJECT_COLUMNS))
        self._poses = RowsByFrame(
            episode.sensor_poses().select(["k", "sensor_id", "location", "rotation_deg"])
        )
        self._world_from_ego = tables.world_from_ego
        by_id = {sensor.id: sensor for sensor in episode.sensors}
        self._swept = [sensor for sensor in episode.sensors if sensor.content in CLOUDS]
        self._cameras = [
            (sensor, by_id.get(sensor.calibration.depth or ""))
            for sensor in episode.sensors
            if sensor.calibration.labelled and sensor.calibration.is_pinhole
        ]
        self._tagged_pictures = episode.spec.labels.pixels
        self._all_have_boxes = _all_have_boxes(episode.spec, VoxelGrid.of(self._asked))

    def check(self, k: int, recorded: frozenset[str], data: Mapping[str, NDArray[Any]]) -> None:
        """Check the file of frame ``k``.

        Args:
            k: the frame.
            recorded: sensors that the ledger has data of.
            data: by sensor, as they are decoded.
        """
        if self._asked is None:
            return
        content = self._files.read(occupancy_name(k), frame=k)
        if content is None:
            return
        try:
            stored = unpack_occupancy(content)
        except ValueError as error:
            self._report(k, f"the file does not decode: {error}")
            return
        poses = {
            row["sensor_id"]: pose_matrix(row["location"], row["rotation_deg"])
            for row in self._poses.rows(k)
        }
        users = road_users(self._objects.rows(k))
        if stored.grid != VoxelGrid.of(self._asked):
            self._report(k, "the voxels are not of the size and resolution that were asked for")
            return
        if not self._is_at_frame(k, stored, users, poses):
            self._report(k, f"the voxels are not around {self._asked.frame}")
            return
        self._check_tags(k, stored)
        self._check_users(k, stored, users)
        self._check_seen(k, stored, users, list(self._seen(k, recorded, data, poses)))

    def _is_at_frame(
        self,
        k: int,
        stored: Occupancy,
        users: Sequence[RoadUser],
        poses: Mapping[str, FloatArray],
    ) -> bool:
        assert self._asked is not None
        if self._asked.frame != EGO:
            pose = poses.get(self._asked.frame)
        else:
            rows = [user.row for user in users if user.row["is_ego"]]
            found = [pose_matrix(one["actor_location"], one["actor_rotation_deg"]) for one in rows]
            pose = found[0] if found else self._world_from_ego.get(k)
        if pose is None:
            return True  # no table says where it is
        return bool(np.abs(pose - stored.world_from_frame).max() <= _POSE_TOLERANCE)

    def _check_tags(self, k: int, stored: Occupancy) -> None:
        known = np.isin(np.arange(256), [*TAGS_0_9_14, FREE])
        self._report_voxels(k, "the class is no tag", ~known[stored.semantic])
        movable = np.isin(np.arange(256), MOVABLE_TAGS)[stored.semantic]
        wrong = movable != (stored.voxels.instance > 0)
        self._report_voxels(k, "class and instance do not go together", wrong)
        if (stored.seen & ~np.uint8(CAMERA | LIDAR)).any():
            self._report(k, "visibility has a bit that means nothing")

    def _check_users(self, k: int, stored: Occupancy, users: Sequence[RoadUser]) -> None:
        """Instances are boxes of the frame: voxels, classes and motion."""
        by_track = {user.track_id: user for user in users if not user.row["is_ego"]}
        world_from_grid = invert_pose(grid_from_world(stored.world_from_frame))
        known = []
        flat = np.flatnonzero(stored.voxels.instance)
        number = stored.voxels.instance.ravel()[flat] - 1
        for place, track in enumerate(stored.voxels.track_id.tolist()):
            user = by_track.get(track)
            own = flat[number == place]
            if user is None or not len(own):
                what = "has no box in this frame" if user is None else "has no voxel"
                self._report(k, f"road user {track} {what}")
                continue
            known.append(user)
            centres = placed(world_from_grid, stored.grid.centres(own))
            local = np.abs(placed(invert_pose(user.world_from_box), centres)) - user.extent_m
            slack = user.reach_m + stored.grid.side_m * np.sqrt(3.0) / 2.0 + 1e-6
            wrong = int((local.max(axis=1) > slack).sum())
            if wrong:
                self._report(k, f"{wrong} voxels of road user {track} are outside of its box")
            tags = set(np.unique(stored.semantic.ravel()[own]).tolist())
            if not tags <= set(box_tags(user.row["class"])):
                self._report(k, f"voxels of road user {track} are not of class {user.tag}")
        if len(known) != len(stored.voxels.track_id):
            return
        expected = motion(stored.world_from_frame, known)
        for name, values in expected.items():
            if not np.allclose(getattr(stored.voxels, name), values, rtol=0.0, atol=1e-3):
                self._report(k, f"{name} is not that of the boxes")

    def _seen(
        self,
        k: int,
        recorded: frozenset[str],
        data: Mapping[str, NDArray[Any]],
        poses: Mapping[str, FloatArray],
    ) -> Iterator[tuple[str, int, bool, Picture | Sweep | None]]:
        """Id and bit of each sensor, whether it tells classes, and what it saw, if known."""
        for sensor, depth in self._cameras:
            seen: Picture | Sweep | None = None
            if (
                depth is not None
                and depth.id in data
                and sensor.id in poses
                and depth.calibration.is_lossless
            ):
                camera = sensor.calibration
                size = camera.width, camera.height
                view = CameraView(camera.k, poses[sensor.id], data[depth.id], *size)
                seen = Picture(view, None)
            yield sensor.id, CAMERA, self._tagged_pictures, seen
        for sensor in self._swept:
            seen = None
            if sensor.id in data and sensor.id in poses and sensor.calibration.is_lossless:
                seen = Sweep(Cloud(poses[sensor.id], points_xyz(data[sensor.id])), None)
            if seen is not None or sensor.id in recorded:
                yield sensor.id, LIDAR, sensor.content == TAGGED_POINTS, seen

    def _check_seen(
        self,
        k: int,
        stored: Occupancy,
        users: Sequence[RoadUser],
        sensors: Sequence[tuple[str, int, bool, Picture | Sweep | None]],
    ) -> None:
        """Masks are what rays make them, and what rays end at is occupied."""
        matrix = grid_from_world(stored.world_from_frame)
        near = _with_neighbours(stored.occupied)
        known, surfaces = [], []
        for name, _, tells_classes, seen in sensors:
            if seen is None:
                continue
            found = surface(stored.grid, matrix, seen)
            known.append(seen)
            surfaces.append(found)
            if tells_classes and self._all_have_boxes:
                self._check_explained(k, name, stored, found, near, users)
        expected = seen_voxels(stored.grid, matrix, known, surfaces)
        for bit, name in ((CAMERA, "camera"), (LIDAR, "LiDAR")):
            wrong = stored.seen ^ expected
            if any(seen is None for _, of, _, seen in sensors if of == bit):
                if bit == LIDAR:
                    continue  # which rays are followed depends on those that are not known
                wrong &= expected  # others may have seen more
            self._report_voxels(k, f"visibility by {name} is wrong", (wrong & bit).astype(np.bool_))

    def _check_explained(
        self,
        k: int,
        name: str,
        stored: Occupancy,
        found: Surface,
        near: NDArray[np.bool_],
        users: Sequence[RoadUser],
    ) -> None:
        """What is on the ego itself is left out of the voxels."""
        world_from_grid = invert_pose(grid_from_world(stored.world_from_frame))
        egos = [user for user in users if user.row["is_ego"]]
        points = placed(world_from_grid, grid_points(stored.grid, found))
        others = owners(points, egos) < 0
        cells, _ = stored.grid.cells(found.points[others])
        if len(cells) < _FEW_POINTS:
            return
        share = float(near.ravel()[cells].mean())
        if share < LEAST_EXPLAINED:
            self._report(
                k, f"voxels explain {share:.3f} of what {name} sees, not {LEAST_EXPLAINED}"
            )

    def _report_voxels(self, k: int, what: str, wrong: NDArray[np.bool_]) -> None:
        count = int(np.count_nonzero(wrong))
        if count:
            first = ", ".join(str(int(i)) for i in np.unravel_index(wrong.argmax(), wrong.shape))
            self._report(k, f"{what} in {count} voxels, first in [{first}]")

    def _report(self, k: int, message: str) -> None:
        self._findings.add("occupancy", f"{occupancy_name(k)}: {message}", frame=k)


def _with_neighbours(occupied: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Voxels that are occupied or touch one that is, by a corner at least."""
    found = occupied.copy()
    for axis in range(3):
        wide = np.moveaxis(found, axis, 0)
        before = wide.copy()
        wide[1:] |= before[:-1]
        wide[:-1] |= before[1:]
    return found


def _all_have_boxes(spec: EpisodeSpec, grid: VoxelGrid) -> bool:
    """Whether no vehicle or pedestrian in the voxels is left out for lack of a box."""
    far = np.maximum(np.abs(grid.low_m), np.abs(np.array(grid.low_m) + grid.lengths_m))
    truth = spec.ground_truth
    return (
        truth.vehicles
        and truth.pedestrians
        and "parked_vehicles" in spec.labels.level_objects
        and float(np.sqrt((far * far).sum())) <= spec.max_distance_m
    )
