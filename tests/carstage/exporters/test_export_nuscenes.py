"""nuScenes exports in nuscenes-devkit: loaded, evaluated, drawn, and compared with the dataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from carstage.dataset import Dataset
from carstage.exporters.formats.nuscenes_files import lidar_file, radar_file
from devkits import NUSCENES_VERSION, check_point_counts, nuscenes_marks

KNOWN = ("car", "truck", "pedestrian")

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture(scope="module")
def nusc(exported, devkit) -> Any:
    return devkit.NuScenes(NUSCENES_VERSION, str(exported("nuscenes")), verbose=False)


def test_the_devkit_loads_it_and_walks_its_links(nusc) -> None:
    (scene,) = nusc.scene
    token, times = scene["first_sample_token"], []
    while token:
        sample = nusc.get("sample", token)
        assert set(sample["data"]) == {"CAM_FRONT", "CAM_LEFT", "LIDAR_TOP"}
        times.append(sample["timestamp"])
        last, token = token, sample["next"]
    assert last == scene["last_sample_token"]
    assert np.diff(times).tolist() == [100_000] * 5
    for instance in nusc.instance:
        token, count = instance["first_annotation_token"], 0
        while token:
            annotation = nusc.get("sample_annotation", token)
            assert annotation["instance_token"] == instance["token"]
            last, token, count = token, annotation["next"], count + 1
        assert (last, count) == (instance["last_annotation_token"], instance["nbr_annotations"])


def test_our_labels_as_predictions_get_full_marks(devkit, nusc, tmp_path: Path) -> None:
    metrics, evaluated = nuscenes_marks(devkit, nusc, tmp_path)
    assert set(evaluated) == set(KNOWN)
    for name in KNOWN:
        assert metrics["mean_dist_aps"][name] == pytest.approx(1.0)
        for error, value in metrics["label_tp_errors"][name].items():
            assert value == pytest.approx(0.0, abs=1e-6), (name, error)


def test_parked_cars_are_parked_and_lights_are_no_objects(nusc) -> None:
    attributes = {
        (row["category_name"], nusc.get("attribute", token)["name"])
        for row in nusc.sample_annotation
        for token in row["attribute_tokens"]
    }
    assert ("vehicle.car", "vehicle.parked") in attributes
    assert {name.split(".")[0] for name, _ in attributes} == {"vehicle", "human"}


def test_boxes_hold_the_points_that_were_counted(devkit, nusc) -> None:
    compared, _ = check_point_counts(devkit, nusc)
    assert compared >= 12


def test_boxes_project_onto_the_2d_boxes(devkit, nusc, dataset) -> None:
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    compared = 0
    for sample in nusc.sample:
        k = round((sample["timestamp"] - nusc.sample[0]["timestamp"]) / 1e5)
        for channel in ("CAM_FRONT", "CAM_LEFT"):
            _, boxes, intrinsic = nusc.get_sample_data(sample["data"][channel])
            for box in boxes:
                uv = devkit.view_points(box.corners(), intrinsic, normalize=True)[:2]
                found = [*uv.min(axis=1), *uv.max(axis=1)]
                depth = float(box.center[2])
                (seen,) = [
                    r for r in rows
                    if r["k"] == k and r["sensor_id"] == channel
                    and abs(r["depth_center"] - depth) < 1e-3
                ]  # fmt: skip
                if not seen["n_behind"]:
                    np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=0.5)
                    compared += 1
    assert compared >= 12


def test_velocities_of_the_devkit_are_those_of_the_labels(nusc, dataset) -> None:
    rows = Dataset(dataset).episodes[0].objects().to_pylist()
    expected = {(r["velocity"][0], -r["velocity"][1]) for r in rows if not r["is_ego"]}
    for annotation in nusc.sample_annotation:
        x, y, _ = nusc.box_velocity(annotation["token"])
        assert min(np.hypot(x - vx, y - vy) for vx, vy in expected) < 1e-4


def test_the_map_begins_at_zero_and_surrounds_the_ego(nusc) -> None:
    (row,) = nusc.map
    mask = row["mask"].mask()
    for pose in nusc.ego_pose:
        x, y = row["mask"].to_pixel_coords(*pose["translation"][:2])
        # 57 m around are cropped out when the devkit draws the map under a LiDAR sweep.
        assert 570 <= x[0] < mask.shape[1] - 570
        assert 570 <= y[0] < mask.shape[0] - 570


def test_the_devkit_draws_a_sample(nusc, tmp_path: Path) -> None:
    sample = nusc.sample[0]
    for channel in ("CAM_FRONT", "LIDAR_TOP"):
        # The map under the sweep is drawn by code that numpy 2.4 does not run any more.
        nusc.render_sample_data(
            sample["data"][channel],
            underlay_map=False,
            out_path=str(tmp_path / f"{channel}.png"),
            verbose=False,
        )
        with Image.open(tmp_path / f"{channel}.png") as picture:
            assert len(np.unique(np.asarray(picture.convert("L")))) > 20
    import matplotlib.pyplot as plt

    plt.close("all")


def test_splits_name_the_scenes(exported) -> None:
    splits = json.loads((exported("nuscenes") / NUSCENES_VERSION / "splits.json").read_text())
    assert splits == {"carstage_train": ["scene-0123456789abcdef"]}


def test_rings_follow_from_elevation() -> None:
    attributes = {"upper_fov": "10.0", "lower_fov": "-30.0", "channels": "5"}
    elevation = np.radians([10.0, 0.0, -10.0, -20.0, -30.0])
    points = np.column_stack(
        [np.cos(elevation), np.zeros(5), np.sin(elevation), np.full(5, 0.5)]
    ).astype(np.float32)
    rows = np.frombuffer(lidar_file(points, attributes), np.float32).reshape(-1, 5)
    assert rows[:, 4].tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(rows[:, 1], points[:, 0])  # forward is y


def test_the_devkit_reads_radar_files(devkit, tmp_path: Path) -> None:
    detections = np.array([[-5.0, 0.1, 0.0, 30.0], [3.0, -0.2, 0.0, 10.0]], np.float32)
    path = tmp_path / "radar.pcd"
    path.write_bytes(radar_file(detections, np.array([10.0, 0.0, 0.0])))
    points = devkit.RadarPointCloud.from_file(str(path)).points
    assert points.shape == (18, 2)
    np.testing.assert_allclose(points[:2, 0], [30 * np.cos(0.1), -30 * np.sin(0.1)], rtol=1e-6)
    # It approaches at 5 m/s while the radar itself drives at 10: it drives away at 5 along the ray.
    rate = 10.0 * np.cos(0.1) - 5.0
    np.testing.assert_allclose(
        points[8:10, 0], [rate * np.cos(0.1), -rate * np.sin(0.1)], rtol=1e-5
    )
    path.write_bytes(radar_file(np.zeros((0, 4), np.float32), np.zeros(3)))
    assert devkit.RadarPointCloud.from_file(str(path)).points.shape == (18, 0)
