"""123D exports, loaded by py123d itself."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import analytic_scene
from analytic_dataset import edit_rows
from carstage.dataset import Dataset, Episode
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry import matrix_from_quaternion, pose_matrix

pytest.importorskip("py123d", reason="py123d is not installed")

from py123d.api import SceneFilter
from py123d.api.scene.arrow.arrow_scene_builder import ArrowSceneBuilder
from py123d.common.execution import SequentialExecutor
from py123d.common.utils.uuid_utils import create_deterministic_uuid
from py123d.datatypes.detections.box_detection_label import DefaultBoxDetectionLabel
from py123d.datatypes.sensors.base_camera import CameraID
from py123d.datatypes.sensors.lidar import LidarID
from py123d.datatypes.sensors.radar import RadarID

pytestmark = pytest.mark.xdist_group("export")
FLIP = np.diag([1.0, -1.0, 1.0, 1.0])
MIRROR = np.array([1.0, -1.0, 1.0])
SIGNS = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
LABELS = {"car": "VEHICLE", "truck": "VEHICLE", "walker_adult": "PERSON",
          "traffic_light": "TRAFFIC_LIGHT"}  # fmt: skip


def scenes(folder: Path, **choices: Any) -> list[Any]:
    builder = ArrowSceneBuilder(folder / "logs", folder / "maps")
    return list(builder.get_scenes(SceneFilter(**choices), SequentialExecutor()))


@pytest.fixture(scope="module")
def folder(every_kind: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "out"
    export_dataset("123d", every_kind, out, workers=0)
    return out


@pytest.fixture(scope="module")
def scene(folder: Path) -> Any:
    (found,) = scenes(folder, datasets=["carstage"], split_types=["train"])
    return found


@pytest.fixture(scope="module")
def episode(every_kind: Path) -> Episode:
    return Dataset(every_kind).episodes[0]


def matrix(pose: Any) -> Any:
    found = np.eye(4)
    found[:3, :3] = matrix_from_quaternion([pose.qw, pose.qx, pose.qy, pose.qz])
    found[:3, 3] = pose.x, pose.y, pose.z
    return found


def test_a_log_has_every_frame_at_its_time_under_its_id(scene: Any, episode: Episode) -> None:
    log = scene.get_log_metadata()
    assert (log.dataset, log.split, log.log_name) == ("carstage", "carstage_train", episode.id)
    assert log.location == "Analytic01"
    times = [time.time_us for time in scene.get_all_iteration_timestamps()]
    assert times == [k * 100_000 for k in range(6)]
    assert scene.get_scene_metadata().initial_uuid == str(
        create_deterministic_uuid(log.split, log.log_name, 0)
    )


def test_every_modality_of_the_rig_is_there(scene: Any) -> None:
    assert set(scene.get_all_modality_metadatas()) == {
        "ego_state_se3", "box_detections_se3", "camera.pcam_f0", "camera.pcam_l0",
        "camera_depth.pcam_f0", "lidar.lidar_top", "radar.radar_front_left", "imu", "gnss",
    }  # fmt: skip


def test_ego_states_are_the_rows_of_the_table(scene: Any, episode: Episode) -> None:
    for row in episode.ego().to_pylist():
        state = scene.get_ego_state_se3_at_iteration(row["k"])
        own = FLIP @ pose_matrix(row["location"], row["rotation_deg"]) @ FLIP
        np.testing.assert_allclose(matrix(state.imu_se3), own, atol=1e-9)
        np.testing.assert_allclose(matrix(state.rear_axle_se3), own, atol=1e-9)
        moving = state.dynamic_state_se3
        np.testing.assert_allclose(moving.velocity_3d.array, row["velocity_ego"] * MIRROR)
        if row["acceleration_ego"] is None:
            assert np.isnan(moving.acceleration_3d.array).all()
        else:
            np.testing.assert_allclose(
                moving.acceleration_3d.array, row["acceleration_ego"] * MIRROR
            )
    box = state.bounding_box_se3
    assert (box.length, box.width, box.height) == pytest.approx(
        [2.0 * half for half in analytic_scene.EGO.extent]
    )
    _, center = analytic_scene.EGO.pose(0.5)
    np.testing.assert_allclose(box.center_se3.array[:3], center * MIRROR, atol=1e-5)
    assert math.isnan(scene.get_ego_state_se3_metadata().wheel_base)


def test_turn_rates_keep_the_sense_of_the_axes(every_kind: Path, tmp_path: Path) -> None:
    """Clockwise seen from above in CARLA is negative about the axis that points up."""
    copy = Path(shutil.copytree(every_kind, tmp_path / "dataset"))
    turn = {"angular_velocity_ego": [0.1, 0.2, 0.3]}
    edit_rows(copy, "ego.parquet", lambda rows: [{**row, **turn} for row in rows])
    gyroscope = {"accelerometer": [1.0, 2.0, 9.0], "gyroscope": [0.1, 0.2, 0.3]}
    edit_rows(copy, "sensors/IMU.parquet", lambda rows: [{**row, **gyroscope} for row in rows])
    export_dataset("123d", copy, tmp_path / "out", workers=0)
    (found,) = scenes(tmp_path / "out")
    state = found.get_ego_state_se3_at_iteration(2)
    np.testing.assert_allclose(state.dynamic_state_se3.angular_velocity.array, [-0.1, 0.2, -0.3])
    reading = found.get_modality_at_iteration(2, "imu")
    np.testing.assert_allclose(reading.angular_velocity.array, [-0.1, 0.2, -0.3])
    np.testing.assert_allclose(reading.linear_acceleration.array, [1.0, -2.0, 9.0])


def test_boxes_are_the_rows_of_the_table(scene: Any, episode: Episode) -> None:
    rows = [row for row in episode.objects().to_pylist() if not row["is_ego"]]
    compared = 0
    for k in range(6):
        wanted = {row["instance_uid"]: row for row in rows if row["k"] == k}
        found = list(scene.get_box_detections_se3_at_iteration(k))
        assert {box.attributes.track_token for box in found} == set(wanted)
        for detection in found:
            row, box = wanted[detection.attributes.track_token], detection.bounding_box_se3
            own = FLIP @ pose_matrix(row["box_center"], row["box_rotation_deg"]) @ FLIP
            np.testing.assert_allclose(matrix(box.center_se3), own, atol=1e-9)
            np.testing.assert_allclose(
                [box.length, box.width, box.height], 2.0 * np.array(row["box_extent"])
            )
            np.testing.assert_allclose(detection.velocity_3d.array, row["velocity"] * MIRROR)
            assert detection.attributes.label == DefaultBoxDetectionLabel[LABELS[row["class"]]]
            points = sum(count for _, count in row["num_lidar_points"])
            assert detection.attributes.num_lidar_points == points
            compared += 1
    assert compared > 20


def test_boxes_project_onto_the_pictures(scene: Any, episode: Episode) -> None:
    """By py123d's own projection, against the labels of the dataset."""
    rows = [row for row in episode.camera_objects().to_pylist() if not row["n_behind"]]
    tokens = {(row["k"], row["track_id"]): row["instance_uid"]
              for row in episode.objects().to_pylist()}  # fmt: skip
    compared = {}
    for sensor, camera_id in (("CAM_FRONT", CameraID.PCAM_F0), ("CAM_LEFT", CameraID.PCAM_L0)):
        for row in (row for row in rows if row["sensor_id"] == sensor):
            camera = scene.get_camera_at_iteration(row["k"], camera_id)
            (box,) = [b.bounding_box_se3
                      for b in scene.get_box_detections_se3_at_iteration(row["k"])
                      if b.attributes.track_token == tokens[row["k"], row["track_id"]]]  # fmt: skip
            half = np.array([box.length, box.width, box.height]) / 2
            corners = np.column_stack([SIGNS * half, np.ones(8)]) @ matrix(box.center_se3).T
            uv, _, depth = camera.project_points_global(corners[:, :3])
            assert (depth > 0.0).all()
            np.testing.assert_allclose(
                [*uv.min(axis=0) + 0.5, *uv.max(axis=0) + 0.5],  # from pixels' centres
                row["bbox_amodal_unclipped"], atol=0.01,
            )  # fmt: skip
            compared[sensor] = compared.get(sensor, 0) + 1
    assert min(compared.values()) >= 6
    assert len(compared) == 2


def test_pictures_depths_and_points_are_the_dataset_s(scene: Any, episode: Episode) -> None:
    camera = scene.get_camera_at_iteration(3, CameraID.PCAM_L0)
    np.testing.assert_array_equal(camera.image, episode.sensor("CAM_LEFT").read(3))
    assert camera.metadata.camera_name == "CAM_LEFT"
    depth = scene.get_camera_depth_at_iteration(3, CameraID.PCAM_F0)
    metres = depth.metadata.decode_depth(depth.image)
    own = np.minimum(episode.sensor("DEPTH_FRONT").read(3), 655.35)
    np.testing.assert_allclose(metres, own, atol=0.0051)
    lidar = scene.get_lidar_at_iteration(3, LidarID.LIDAR_TOP)
    points = episode.sensor("LIDAR_TOP").read(3)
    pose = FLIP @ episode.sensor("LIDAR_TOP").calibration.ego_from_sensor @ FLIP
    np.testing.assert_allclose(matrix(lidar.metadata.lidar_to_imu_se3), pose, atol=1e-9)
    on_ego = points[:, :3] * MIRROR @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(lidar.point_cloud_3d, on_ego, atol=1e-5)
    np.testing.assert_allclose(lidar.intensity / 255.0, points[:, 3], atol=0.5 / 255.0 + 1e-6)
    assert lidar.timestamp.time_us == lidar.timestamp_end.time_us == 300_000


def test_detections_of_a_radar_point_from_the_radar(scene: Any, episode: Episode) -> None:
    radar = scene.get_radar_at_iteration(3, RadarID.RADAR_FRONT_LEFT)
    pose = FLIP @ episode.sensor("RADAR_LEFT").calibration.ego_from_sensor @ FLIP
    away = radar.point_cloud_3d - pose[:3, 3]
    detections = analytic_scene.DETECTIONS.astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), detections[:, 3], rtol=1e-5)
    rays = away / detections[:, 3:]
    x, y = radar.point_cloud_features["velocity_x"], radar.point_cloud_features["velocity_y"]
    np.testing.assert_allclose(np.column_stack([x, y]), detections[:, :1] * rays[:, :2], atol=1e-5)


def test_fixes_are_degrees_over_the_pivot(scene: Any, episode: Episode) -> None:
    for row in episode.ego().to_pylist():
        fix = scene.get_modality_at_iteration(row["k"], "gnss")
        assert fix.latitude == pytest.approx(row["latitude_deg"], abs=1e-10)
        assert fix.longitude == pytest.approx(row["longitude_deg"], abs=1e-10)
        assert fix.altitude == pytest.approx(row["altitude_m"] + 2.0)


def test_missing_data_leaves_the_other_modalities_of_its_frame(
    every_kind: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(every_kind, tmp_path / "dataset"))
    next(copy.glob("episodes/*/*/sensors/CAM_LEFT/000002.png")).unlink()
    options = ExportOptions(classes=("car",))
    export_dataset("123d", copy, tmp_path / "out", options, workers=0, allow_incomplete=True)
    (found,) = scenes(tmp_path / "out")
    assert found.get_camera_at_iteration(2, CameraID.PCAM_L0) is None
    own = Dataset(every_kind).episodes[0].sensor("CAM_LEFT").read(3)
    np.testing.assert_array_equal(found.get_camera_at_iteration(3, CameraID.PCAM_L0).image, own)
    labels = {b.attributes.label for b in found.get_box_detections_se3_at_iteration(2)}
    assert labels == {DefaultBoxDetectionLabel.VEHICLE}


def test_what_has_no_place_is_counted(every_kind: Path, tmp_path: Path) -> None:
    options = ExportOptions(cameras=("CAM_LEFT",))
    summary = export_dataset("123d", every_kind, tmp_path / "out", options, workers=0)
    assert summary.sensors_left_out == dict.fromkeys(
        ["CAM_FRONT", "DEPTH_FRONT", "FLOW_FRONT", "INST_FRONT", "NORMALS_LEFT", "SEMLIDAR_TOP",
         "SEM_FRONT"], 6,
    )  # fmt: skip
