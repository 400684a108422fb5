"""Whether bird's-eye grids are what map, labels and sensors of their frame make them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye import (
    LAYERS,
    BirdsEye,
    CameraView,
    Cloud,
    Drawn,
    Grid,
    TownShapes,
    birds_eye_name,
    draw_birds_eye,
    unpack_birds_eye,
)
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.saved_frames import RowsByFrame
from carstage.errors import DatasetError
from carstage.geometry import FloatArray, pose_matrix
from carstage.sensor_kinds.model import CLOUDS
from carstage.validation.checks.files import VerifiedFiles
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

_POSE_TOLERANCE = 1e-3
"""Metres and degrees."""
_OBJECT_COLUMNS = [
    "k", "track_id", "class", "is_ego", "box_center", "box_rotation_deg", "box_extent", "velocity",
    "actor_location", "actor_rotation_deg",
]  # fmt: skip


class BirdsEyeChecks:
    """Draws the grids of an episode again, frame after frame.

    Args:
        episode: the episode.
        tables: its label tables.
        files: reads and verifies the grids' files.
        findings: check ``birds_eye``.
    """

    def __init__(
        self, episode: Episode, tables: LabelTables, files: VerifiedFiles, findings: Findings
    ) -> None:
        self._asked = episode.spec.labels.birds_eye
        self._files, self._findings = files, findings
        self._town: TownShapes | None = None
        if self._asked is None:
            return
        try:
            town = episode.vector_map()
        except DatasetError:
            self._asked = None  # the check of vector maps says so
            return
        if town is not None:
            self._town = TownShapes.of(town, self._asked.resolution_m)
        self._objects = RowsByFrame(tables.objects.select(_OBJECT_COLUMNS))
        seen = tables.camera_objects.filter(tables.camera_objects["visible"])
        self._seen = RowsByFrame(seen.select(["k", "track_id"]))
        self._poses = RowsByFrame(
            episode.sensor_poses().select(["k", "sensor_id", "location", "rotation_deg"])
        )
        self._world_from_ego = tables.world_from_ego
        sensors = episode.sensors
        self._swept = [sensor for sensor in sensors if sensor.content in CLOUDS]
        self._cameras = [s for s in sensors if s.calibration.labelled and s.calibration.is_pinhole]
        by_id = {sensor.id: sensor for sensor in sensors}
        self._depth = {
            sensor.id: by_id[sensor.calibration.depth]
            for sensor in self._cameras
            if sensor.calibration.depth in by_id
        }

    def check(self, k: int, recorded: frozenset[str], data: Mapping[str, NDArray[Any]]) -> None:
        """Compare the file of frame ``k`` with what follows.

        Args:
            k: the frame.
            recorded: sensors that the ledger has data of.
            data: by sensor, as they are decoded.
        """
        if self._asked is None:
            return
        content = self._files.read(birds_eye_name(k), frame=k)
        if content is None:
            return
        try:
            stored = unpack_birds_eye(content)
        except ValueError as error:
            self._report(k, f"the file does not decode: {error}")
            return
        if stored.grid != Grid.of(self._asked):
            self._report(k, "the grid is not of the size and resolution that were asked for")
            return
        objects = self._objects.rows(k)
        if not self._is_at_ego(k, stored, objects):
            self._report(k, "the grid is not where the ego is")
            return
        poses = {
            row["sensor_id"]: pose_matrix(row["location"], row["rotation_deg"])
            for row in self._poses.rows(k)
        }
        views = [self._view(sensor, poses, data) for sensor in self._cameras if sensor.id in poses]
        expected = draw_birds_eye(
            stored.grid,
            stored.pose,
            self._town,
            objects,
            {row["track_id"] for row in self._seen.rows(k)},
            views,
            [
                Cloud(poses[sensor.id], points_xyz(data[sensor.id]))
                for sensor in self._swept
                if sensor.id in data and sensor.id in poses
            ],
        )
        self._compare(k, stored.drawn, expected)
        self._compare_visible(
            k,
            stored.drawn,
            expected,
            all_depths=all(view.depth_m is not None for view in views),
            all_points=all(
                s.id in data and s.calibration.is_lossless for s in self._swept if s.id in recorded
            ),
        )

    def _is_at_ego(self, k: int, stored: BirdsEye, objects: list[dict[str, Any]]) -> bool:
        ego = next((row for row in objects if row["is_ego"]), None)
        pose = (
            None if ego is None else pose_matrix(ego["actor_location"], ego["actor_rotation_deg"])
        )
        pose = self._world_from_ego.get(k) if pose is None else pose
        if pose is None:
            return True  # no table says where the ego is
        at = stored.pose
        yaw_deg = np.degrees(np.arctan2(pose[1, 0], pose[0, 0]))
        turned = (at.yaw_deg - yaw_deg + 180.0) % 360.0 - 180.0
        off = [at.x_m - pose[0, 3], at.y_m - pose[1, 3], at.z_m - pose[2, 3], turned]
        return bool(np.abs(off).max() <= _POSE_TOLERANCE)

    def _view(
        self, sensor: Sensor, poses: Mapping[str, FloatArray], data: Mapping[str, NDArray[Any]]
    ) -> CameraView:
        camera, depth = sensor.calibration, self._depth.get(sensor.id)
        image = data.get(depth.id) if depth is not None and depth.calibration.is_lossless else None
        return CameraView(camera.k, poses[sensor.id], image, camera.width, camera.height)

    def _compare(self, k: int, stored: Drawn, expected: Drawn) -> None:
        differing = stored.semantic ^ expected.semantic
        for number, name in enumerate(LAYERS):
            self._report_cells(k, f"layer {name}", (differing >> number & 1).astype(np.bool_))
        tracks, others = (
            np.append(np.int64(0), drawn.track_id)[drawn.instance] for drawn in (stored, expected)
        )
        self._report_cells(k, "the instance", tracks != others)
        self._report_cells(k, "the height", stored.height_cm != expected.height_cm)
        if not np.array_equal(stored.track_id, expected.track_id):
            self._report(k, "the tracks are not those of the objects in the grid")
        elif not np.allclose(stored.velocity_m_s, expected.velocity_m_s, rtol=0.0, atol=1e-4):
            self._report(k, "a velocity is not that of its object")

    def _compare_visible(
        self, k: int, stored: Drawn, expected: Drawn, *, all_depths: bool, all_points: bool
    ) -> None:
        """Without depth images nothing may be seen that no camera looks at."""
        wrong = stored.visible ^ expected.visible
        by_camera = wrong if all_depths else wrong & stored.visible
        self._report_cells(k, "visibility by camera", (by_camera & CAMERA).astype(np.bool_))
        if all_points:
            self._report_cells(k, "visibility by LiDAR", (wrong & LIDAR).astype(np.bool_))
        if (stored.visible & ~np.uint8(CAMERA | LIDAR)).any():
            self._report(k, "visibility has a bit that means nothing")

    def _report_cells(self, k: int, what: str, wrong: NDArray[np.bool_]) -> None:
        count = int(np.count_nonzero(wrong))
        if count:
            row, column = divmod(int(np.argmax(wrong)), wrong.shape[1])
            self._report(
                k, f"{what} is wrong in {count} cells, first in row {row}, column {column}"
            )

    def _report(self, k: int, message: str) -> None:
        self._findings.add("birds_eye", f"{birds_eye_name(k)}: {message}", frame=k)
