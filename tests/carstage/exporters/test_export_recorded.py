"""Exports of two recorded drives in the formats' own devkits: every label gets full marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely

from carstage.dataset import Dataset
from carstage.exporters import ExportOptions, export_dataset
from devkits import (
    NUSCENES_VERSION,
    check_point_counts,
    coco_marks,
    nuscenes_marks,
    nuscenes_tracks,
)
from kitti_geometry import calibration, corners, pixels
from mcap_reading import foxglove_messages
from recorded_dataset import FRAMES

WIDTH, HEIGHT = 160, 90

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.xdist_group("recorded"),
    # pycocotools 2.0.11 speaks numpy 1's protocol of arrays.
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),
]


@pytest.fixture(scope="module")
def export(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    def run(name: str, **choices: Any) -> Path:
        out = tmp_path_factory.mktemp("export") / name
        export_dataset(name, recorded, out, ExportOptions(**choices), workers=0)
        return out

    return run


@pytest.fixture(scope="module")
def nusc(export: Callable[..., Path], devkit: SimpleNamespace) -> Any:
    return devkit.NuScenes(
        NUSCENES_VERSION, str(export("nuscenes", keyframes_hz=10.0)), verbose=False
    )


def test_nuscenes_evaluation_finds_no_error(devkit, nusc, tmp_path: Path) -> None:
    assert len(nusc.scene) == 2
    assert len(nusc.sample) == 2 * FRAMES
    marks, evaluated = nuscenes_marks(devkit, nusc, tmp_path)
    assert min(evaluated["car"], evaluated["pedestrian"]) > 20
    for name in evaluated:
        assert marks["mean_dist_aps"][name] == pytest.approx(1.0), name
        for error, value in marks["label_tp_errors"][name].items():
            assert value == pytest.approx(0.0, abs=1e-6), (name, error)


def test_nuscenes_tracking_loses_nobody(devkit, nusc, tmp_path: Path) -> None:
    marks = nuscenes_tracks(devkit, nusc, tmp_path)
    assert marks["amota"] == pytest.approx(1.0)
    assert marks["amotp"] == pytest.approx(0.0, abs=1e-6)
    assert (marks["recall"], marks["mota"]) == (1.0, 1.0)
    assert [marks[name] for name in ("ids", "frag", "fp", "fn")] == [0.0] * 4
    assert marks["tp"] > 50


def test_nuscenes_tracking_sees_tracks_that_are_renamed(devkit, nusc, tmp_path: Path) -> None:
    late = {row["token"] for row in nusc.sample if row["timestamp"] % 1_000_000 >= 500_000}

    def renamed(row: dict[str, Any]) -> str:
        return f"{row['instance_token']} {row['sample_token'] in late}"

    marks = nuscenes_tracks(devkit, nusc, tmp_path, renamed)
    assert marks["ids"] > 5
    assert marks["amota"] < 1.0


def test_nuscenes_boxes_hold_the_points_that_were_counted(devkit, nusc) -> None:
    compared, exact = check_point_counts(devkit, nusc)
    assert compared > 200
    assert exact > 0.8 * compared


@pytest.mark.parametrize("categories", ["own", "coco80"])
@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_coco_evaluation_gives_full_marks(export, kind: str, categories: str) -> None:
    pycocotools = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    coco = pycocotools.COCO(
        str(export("coco", categories=categories) / "annotations/instances_train.json")
    )
    assert len(coco.dataset["images"]) == 2 * 2 * FRAMES
    precision, found = coco_marks(coco, kind)
    assert precision == pytest.approx(1.0)
    assert found > 50


def test_kitti_labels_project_back_within_a_pixel(export, recorded: Path) -> None:
    training = export("kitti-object", boxes="amodal") / "training"
    rows = [
        {**row, "n": n * FRAMES + row["k"]}
        for n, episode in enumerate(Dataset(recorded).episodes)
        for row in episode.camera_objects().to_pylist()
        if row["sensor_id"] == "CAM_FRONT" and row["location"] is not None
    ]
    picture, episodes = shapely.box(0, 0, WIDTH, HEIGHT), set()
    for n in range(2 * FRAMES):
        projection = calibration(training / f"calib/{n:06d}.txt")["P2"]
        for line in (training / f"label_2/{n:06d}.txt").read_text().splitlines():
            if line.startswith("DontCare"):
                continue
            values = [float(number) for number in line.split()[1:]]
            left, top, right, bottom, *box = values[3:]
            (seen,) = [
                row
                for row in rows
                if row["n"] == n and np.abs(np.subtract(row["location"], box[3:6])).max() < 1e-3
            ]
            if seen["n_behind"]:
                continue
            uv = pixels(corners(box), projection)
            found = [*uv.min(axis=0), *uv.max(axis=0)]
            np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=1.0)
            # What is left in the picture may be lower than the whole: not the clipped bounds.
            inside = shapely.MultiPoint(uv).convex_hull.intersection(picture).bounds
            np.testing.assert_allclose([left, top, right + 1, bottom + 1], inside, atol=1.0)
            episodes.add(n // FRAMES)
    assert episodes == {0, 1}


def test_mcap_has_every_sensor_and_fixes_of_the_ego_s_globe(export, recorded: Path) -> None:
    """The server counts north at +y, and its receiver stands in the ego's pivot."""
    pytest.importorskip("mcap", reason="the extra mcap is not installed")
    episodes = Dataset(recorded).episodes
    assert {episode.geo_frame.gnss_north for episode in episodes} == {"+y"}
    out = export("mcap")
    for episode in episodes:
        read = foxglove_messages(out / f"{episode.id}.mcap")
        for sensor in episode.sensors:
            assert [topic for topic in read if topic.startswith(f"/{sensor.id}/")], sensor.id
        fixes = [fix for _, fix in read["/GNSS/fix"]]
        for row, fix in zip(episode.ego().to_pylist(), fixes, strict=True):
            assert fix.latitude == pytest.approx(row["latitude_deg"], abs=1e-8)
            assert fix.longitude == pytest.approx(row["longitude_deg"], abs=1e-8)
            assert fix.altitude == pytest.approx(row["altitude_m"], abs=1e-3)
        assert {len(entries) for entries in read.values()} == {FRAMES}


def test_py123d_loads_both_drives(export, recorded: Path) -> None:
    pytest.importorskip("py123d", reason="py123d is not installed")
    from py123d.api import SceneFilter
    from py123d.api.scene.arrow.arrow_scene_builder import ArrowSceneBuilder
    from py123d.common.execution import SequentialExecutor
    from py123d.datatypes.sensors.lidar import LidarID

    out = export("123d")
    builder = ArrowSceneBuilder(out / "logs", out / "maps")
    scenes = {s.log_name: s for s in builder.get_scenes(SceneFilter(), SequentialExecutor())}
    episodes = Dataset(recorded).episodes
    assert set(scenes) == {episode.id for episode in episodes}
    held = 0
    for episode in episodes:
        scene = scenes[episode.id]
        assert scene.number_of_iterations == FRAMES
        for row in episode.ego().to_pylist():
            state = scene.get_ego_state_se3_at_iteration(row["k"])
            x, y, z = row["location"]
            np.testing.assert_allclose(state.imu_se3.array[:3], [x, -y, z], atol=1e-9)
            points = scene.get_lidar_at_iteration(row["k"], LidarID.LIDAR_TOP).point_cloud_3d
            held += _held(scene.get_box_detections_se3_at_iteration(row["k"]), state, points)
    assert held > 20


def _held(boxes: Any, state: Any, points: Any) -> int:
    """Boxes whose points py123d finds where the labels count them, to a point in twenty."""
    from py123d.geometry.transform import abs_to_rel_points_3d_array, rel_to_abs_points_3d_array

    on_map, held = rel_to_abs_points_3d_array(state.imu_se3, points.astype(np.float64)), 0
    for detection in boxes:
        box = detection.bounding_box_se3
        local = abs_to_rel_points_3d_array(box.center_se3, on_map)
        half = np.array([box.length, box.width, box.height]) / 2.0
        inside = int((np.abs(local) <= half + 1e-3).all(axis=1).sum())
        counted = detection.attributes.num_lidar_points
        # The road under a vehicle is the bottom of its box: points there fall to either side.
        if counted >= 20:
            above = int((np.abs(local) <= half - [0.0, 0.0, 0.05]).all(axis=1).sum())
            assert above <= counted <= inside
            held += 1
    return held
