"""Sweeping LiDARs recorded from the embedded simulator: files, labels, checks, exports."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import carstage
from analytic_dataset import attempt_of, recommit
from carstage.config import parse_config
from carstage.dataset import Dataset, Episode
from carstage.errors import ConfigError
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry import pose_matrix, transform_points
from carstage.sensor_kinds.columns import SweepPoint
from carstage.validation import validate_dataset
from mcap_reading import foxglove_messages

pytestmark = [pytest.mark.end_to_end]

CHANNELS, FPS = 24, 10
SCAN = {"channels": CHANNELS, "points_per_second": CHANNELS * 400 * FPS, "range_m": 80.0}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweeping") / "out"
    asked = {
        "seed": 7, "duration_s": 0.5, "fps": FPS, "map": "Stage01", "server": {"self_test": "off"},
        "vehicles": {"count": 20}, "pedestrians": {"count": 6},
        "rig": {"sensors": [
            {"id": "RGB", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6},
             "attributes": {"image_size": [320, 180]}},
            {"id": "SWEEP", "kind": "sweeping_lidar", "pose": {"z": 2.4}, "attributes": SCAN},
            {"id": "VLP16", "kind": "sweeping_lidar", "product": "velodyne_vlp16",
             "pose": {"x": 1.0, "z": 2.4, "yaw_deg": 90}},
        ]},
    }  # fmt: skip
    assert carstage.run(asked, folder).state == "done"
    return folder


@pytest.fixture(scope="module")
def episode(dataset: Path) -> Episode:
    (found,) = Dataset(str(dataset)).episodes
    return found


def poses(episode: Episode, k: int) -> list[NDArray[np.float64]]:
    """Location, and pitch, yaw, roll, of SWEEP on the map in a frame."""
    rows = episode.sensor_poses().to_pylist()
    (row,) = [one for one in rows if one["k"] == k and one["sensor_id"] == "SWEEP"]
    return [np.array(row["location"]), np.array(row["rotation_deg"])]


def test_measured_points_go_to_the_world_by_their_own_poses_as_the_others_do_by_the_last(
    episode: Episode,
) -> None:
    moved = []
    for k in range(1, episode.frames):
        points = episode.sensor("SWEEP").read(k).astype(np.float64)
        (before, before_deg), (now, now_deg) = poses(episode, k - 1), poses(episode, k)
        turn_deg = np.remainder(now_deg - before_deg + 180.0, 360.0) - 180.0
        world = transform_points(pose_matrix(now, now_deg), points[:, :3])
        measured = points[:, SweepPoint.X_MEASURED :]
        times, which = np.unique(points[:, SweepPoint.TIME], return_inverse=True)
        for time_s, column in zip(times, np.arange(len(times)), strict=True):
            part = -time_s * FPS
            own = pose_matrix(now - part * (now - before), now_deg - part * turn_deg)
            some = which == column
            np.testing.assert_allclose(
                transform_points(own, measured[some]), world[some], atol=0.005
            )
        moved.append(np.abs(measured - points[:, :3]).max())
    assert max(moved) > 0.3  # the ego drives


def test_times_and_rings_are_those_of_a_turning_head(episode: Episode) -> None:
    points = episode.sensor("SWEEP").read(2)
    assert points.shape[1] == len(SweepPoint) + 3
    assert -1.0 / FPS - 1e-6 <= points[:, SweepPoint.TIME].min() < -0.09
    assert -0.001 < points[:, SweepPoint.TIME].max() < 0.0
    assert set(np.unique(points[:, SweepPoint.RING])) <= set(range(CHANNELS))
    azimuth = np.arctan2(points[:, SweepPoint.Y_MEASURED], points[:, SweepPoint.X_MEASURED])
    part = 1.0 + points[:, SweepPoint.TIME] * FPS
    np.testing.assert_allclose((azimuth / np.pi + 1.0) / 2.0, part, atol=1e-4)


def test_what_the_dataset_promises_of_it_holds(dataset: Path, episode: Episode) -> None:
    report = validate_dataset(dataset)
    assert [p.message for p in report.problems if p.severity == "error"] == []
    counted = [dict(row["num_lidar_points"]) for row in episode.objects().to_pylist()]
    assert any(counts.get("SWEEP", 0) > 5 for counts in counted)


@pytest.mark.parametrize(
    ("name", "clouds"),
    [("kitti-object", "training/velodyne/*.bin"), ("nuscenes", "samples/LIDAR_TOP/*.bin")],
)
def test_exports_take_the_points_without_motion(
    dataset: Path, episode: Episode, tmp_path: Path, name: str, clouds: str
) -> None:
    options = ExportOptions(lidar="SWEEP", cameras=("RGB",))
    export_dataset(name, str(dataset), str(tmp_path / "out"), options, workers=1)
    columns = 4 if name == "kitti-object" else 5
    exported = [
        np.fromfile(path, "<f4").reshape(-1, columns)
        for path in sorted((tmp_path / "out").glob(clouds))
    ]
    assert len(exported) > 0
    own = episode.sensor("SWEEP").read(0)
    np.testing.assert_allclose(
        np.linalg.norm(exported[0][:, :3], axis=1), np.linalg.norm(own[:, :3], axis=1), rtol=1e-4
    )
    if columns == 5:
        np.testing.assert_array_equal(exported[0][:, 4], own[:, SweepPoint.RING])


def test_mcap_has_all_columns_in_its_own_axes(
    dataset: Path, episode: Episode, tmp_path: Path
) -> None:
    export_dataset("mcap", str(dataset), str(tmp_path / "out"), ExportOptions(), workers=1)
    (path,) = (tmp_path / "out").glob("*.mcap")
    _, cloud = foxglove_messages(path)["/SWEEP/points"][0]
    own = episode.sensor("SWEEP").read(0)
    names = [field.name for field in cloud.fields]
    assert names[4:] == ["time_s", "ring", "x_measured", "y_measured", "z_measured"]
    written = np.frombuffer(cloud.data, "<f4").reshape(len(own), len(names))
    for column in (1, int(SweepPoint.Y_MEASURED)):
        np.testing.assert_array_equal(written[:, column], -own[:, column])
    np.testing.assert_array_equal(written[:, 6], own[:, 6])


def motion_left_in(points: NDArray[np.float32]) -> None:
    points[:, :3] = points[:, SweepPoint.X_MEASURED :]


def later(points: NDArray[np.float32]) -> None:
    points[::7, SweepPoint.TIME] /= 2.0


def other_rings(points: NDArray[np.float32]) -> None:
    points[::7, SweepPoint.RING] += 1.0


@pytest.mark.parametrize("damage", [motion_left_in, later, other_rings])
def test_wrong_times_rings_and_motion_are_found(
    dataset: Path, tmp_path: Path, damage: Callable[[Any], None]
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(dataset, copy)
    (path,) = (attempt_of(copy) / "sensors" / "SWEEP").glob("000003.bin")
    points = np.fromfile(path, "<f4").reshape(-1, 9)
    damage(points)
    points.tofile(path)
    recommit(copy)
    assert "sweep_motion" in {problem.check for problem in validate_dataset(copy).problems}


def test_labels_of_a_semantic_lidar_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"lidars\[0\]: no semantic LiDAR scans like a sweeping"):
        parse_config("{rig: {sensors: [{id: S, kind: sweeping_lidar}]}, labels: {lidars: [S]}}")
