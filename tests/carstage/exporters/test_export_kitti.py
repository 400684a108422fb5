"""KITTI exports, parsed as KITTI's readers do and projected back into the pictures."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from analytic_dataset import SIZE, attempt_of, edit_rows, recommit
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from kitti_geometry import calibration, corners, pixels

WIDTH, HEIGHT = SIZE

pytestmark = pytest.mark.xdist_group("export")


def test_labels_parse_and_project_back_within_a_pixel(exported, dataset) -> None:
    training = exported("kitti-object", boxes="amodal") / "training"
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    compared = dont_care = 0
    for k in range(6):
        projection = calibration(training / f"calib/{k:06d}.txt")["P2"]
        for line in (training / f"label_2/{k:06d}.txt").read_text().splitlines():
            name, *numbers = line.split()
            if name == "DontCare":
                dont_care += 1
                continue
            assert name in ("Car", "Truck", "Pedestrian")
            values = [float(number) for number in numbers]
            assert len(values) == 14
            truncated, occluded, alpha, left, top, right, bottom, *box = values
            assert 0.0 <= truncated <= 1.0
            assert occluded in (0, 1, 2, 3)
            assert -np.pi <= alpha <= np.pi
            # A pixel index, the last one included: KITTI's boxes end at W - 1.
            assert 0.0 <= left <= right <= WIDTH - 1
            assert 0.0 <= top <= bottom <= HEIGHT - 1
            (seen,) = [
                r for r in rows
                if r["k"] == k and r["sensor_id"] == "CAM_FRONT"
                and abs(r["depth_center"] - box[5]) < 1e-4
            ]  # fmt: skip
            uv = pixels(corners(box), projection)
            found = [*uv.min(axis=0), *uv.max(axis=0)]
            np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=0.05)
            inside = np.clip(found, 0, [WIDTH, HEIGHT, WIDTH, HEIGHT])
            np.testing.assert_allclose([left, top, right + 1, bottom + 1], inside, atol=1.0)
            compared += 1
    assert compared >= 12
    assert dont_care >= 1  # the light


def test_velodyne_points_land_on_the_depth_image(exported, dataset) -> None:
    training = exported("kitti-object") / "training"
    episode = Dataset(dataset).episodes[0]
    for k in (0, 5):
        matrices = calibration(training / f"calib/{k:06d}.txt")
        points = np.fromfile(training / f"velodyne/{k:06d}.bin", np.float32).reshape(-1, 4)
        assert len(points) == len(episode.sensor("LIDAR_TOP").read(k))
        homogeneous = np.column_stack([points[:, :3], np.ones(len(points))])
        camera = homogeneous @ matrices["Tr_velo_to_cam"].T @ matrices["R0_rect"].T
        camera = camera[camera[:, 2] > 0.5]
        u, v = np.floor(pixels(camera, matrices["P2"])).astype(int).T
        seen = (u >= 0) & (u < WIDTH) & (v >= 0) & (v < HEIGHT)
        depth = episode.sensor("DEPTH_FRONT").read(k)[v[seen], u[seen]]
        z = camera[seen, 2]
        assert len(z) > 100
        # Points beside an edge, and on the road where a pixel spans metres, may differ.
        assert np.mean(np.abs(depth - z) < 0.05 * z) > 0.9


def test_pictures_are_the_dataset_s_own(exported, dataset) -> None:
    training = exported("kitti-object") / "training"
    episode = Dataset(dataset).episodes[0]
    with Image.open(training / "image_2/000004.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), episode.sensor("CAM_FRONT").read(4))


def test_the_index_leads_back_to_the_dataset(exported) -> None:
    lines = (exported("kitti-object") / "frames.csv").read_text().splitlines()
    assert lines[0] == "name,episode_id,k,timestamp_s,camera"
    assert lines[3] == "000002,0123456789abcdef,2,0.200000,CAM_FRONT"
    assert len(lines) == 7


@pytest.mark.parametrize(
    ("choices", "column"),
    [({}, "occluded_px"), ({"occlusion": "stage_vo"}, "occluded")],
)
def test_boxes_are_tight_around_what_is_seen(exported, dataset, choices, column: str) -> None:
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    out = exported("kitti-object", **choices)
    labels = (out / "training/label_2/000000.txt").read_text().splitlines()
    seen = sorted(
        (r for r in rows if r["k"] == 0 and r["sensor_id"] == "CAM_FRONT" and r["visible"]),
        key=lambda r: r["track_id"],
    )
    assert len(labels) == len(seen)
    for line, row in zip(labels, seen, strict=True):
        values = line.split()
        assert int(values[2]) == (-1 if values[0] == "DontCare" else row[column])
        x0, y0, x1, y1 = row["bbox_modal"]
        assert [float(v) for v in values[4:8]] == [x0, y0, x1 - 1, y1 - 1]


def test_what_has_no_3d_box_is_no_reason_to_punish_a_detector(dataset, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "dataset"))

    def without_3d(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        lost = dict.fromkeys(("location", "dimensions", "rotation_y", "alpha"))
        return [{**row, **(lost if row["track_id"] == 50 else {})} for row in rows]

    edit_rows(copy, "camera_objects.parquet", without_3d)
    export_dataset("kitti-object", copy, tmp_path / "out", workers=0)
    (seen,) = [
        row
        for row in Dataset(copy).episodes[0].camera_objects().to_pylist()
        if (row["track_id"], row["k"], row["sensor_id"]) == (50, 0, "CAM_FRONT")
    ]
    x0, y0, x1, y1 = seen["bbox_modal"]
    lines = (tmp_path / "out/training/label_2/000000.txt").read_text().splitlines()
    box = f"{x0:.2f} {y0:.2f} {x1 - 1:.2f} {y1 - 1:.2f}"
    assert f"DontCare -1 -1 -10 {box} -1 -1 -1 -1000 -1000 -1000 -10" in lines


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        ("kitti-object", "--boxes amodal --occlusion stage_vo"),
        ("kitti-tracking", "--boxes amodal --occlusion stage_vo"),
        ("yolo", "--boxes amodal"),
        ("coco", "--boxes amodal"),
    ],
)
def test_a_recording_without_counted_pixels_is_refused_with_the_way_out(
    dataset, tmp_path: Path, name: str, way_out: str
) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "dataset"))
    path = attempt_of(copy) / "episode.json"
    document = json.loads(path.read_text())
    document["spec"]["labels"]["method"] = "stage_vo"
    path.write_text(json.dumps(document))
    recommit(copy)
    with pytest.raises(BadInputError, match="were not counted") as refused:
        export_dataset(name, copy, tmp_path / "out", workers=0)
    assert refused.value.hint.endswith(f"or choose {way_out}.")
    choices = dict(zip(("boxes", "occlusion"), way_out.split()[1::2], strict=False))
    options = ExportOptions(**choices)  # type: ignore[arg-type]
    assert export_dataset(name, copy, tmp_path / "out", options, workers=0).frames == 6


def test_filters_leave_objects_out(exported) -> None:
    def names(**choices: object) -> set[str]:
        folder = exported("kitti-object", **choices) / "training/label_2"
        return {line.split()[0] for p in folder.iterdir() for line in p.read_text().splitlines()}

    assert names() == {"Car", "Truck", "Pedestrian", "DontCare"}
    assert "Truck" not in names(max_distance_m=16.0)
    assert names(min_lidar_points=100_000) == set()


def test_tracks_are_numbered_from_zero_and_keep_their_class(exported) -> None:
    training = exported("kitti-tracking") / "training"
    tracks: dict[int, set[str]] = {}
    frames = set()
    for line in (training / "label_02/0000.txt").read_text().splitlines():
        frame, track, name, truncated, occluded, *rest = line.split()
        if name == "DontCare":
            assert (track, truncated, occluded) == ("-1", "-1", "-1")
            continue
        assert truncated in ("0", "1", "2")
        assert occluded in ("0", "1", "2", "3")
        assert len(rest) == 12
        frames.add(int(frame))
        tracks.setdefault(int(track), set()).add(name)
    assert frames == set(range(6))
    assert sorted(tracks) == list(range(len(tracks)))
    assert all(len(names) == 1 for names in tracks.values())


def test_a_sequence_has_calibration_inertial_rows_and_the_devkit_s_list(exported) -> None:
    out = exported("kitti-tracking")
    matrices = calibration(out / "training/calib/0000.txt")
    assert list(matrices) == [
        "P0", "P1", "P2", "P3", "R_rect", "Tr_velo_cam", "Tr_imu_velo"
    ]  # fmt: skip
    rows = np.loadtxt(out / "training/oxts/0000.txt")
    assert rows.shape == (6, 30)
    # The ego heads 8 degrees to the right of east: clockwise, so a negative yaw.
    np.testing.assert_allclose(np.degrees(rows[:, 5]), -8.0)
    np.testing.assert_allclose(rows[:, 8], 5.0, atol=1e-5)  # forward speed
    np.testing.assert_allclose(np.hypot(rows[:, 6], rows[:, 7]), 5.0, atol=1e-5)
    np.testing.assert_allclose(rows[:, 13], 9.81)  # gravity along its up axis
    assert np.all(rows[:, 6] < 0.0)  # to the south
    seqmap = (out / "evaluate_tracking.seqmap.train").read_text()
    assert seqmap == "0000 empty 000000 000006\n"
    assert len(list((out / "training/image_02/0000").iterdir())) == 6


@pytest.fixture(scope="module")
def every_camera(segmented, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Exports of all cameras of a drive with sensors on the ego and on another car."""
    folder = tmp_path_factory.mktemp("every_camera")
    options = ExportOptions(cameras=("all",), boxes="amodal")
    for name in ("kitti-object", "kitti-tracking"):
        export_dataset(name, segmented, folder / name, options, workers=0)
    return {name: folder / name for name in ("kitti-object", "kitti-tracking")}


CAMERAS = ["CAM_FRONT", "CAM_LEFT", "CAM_AUDI"]


def test_every_camera_of_every_car_is_exported(every_camera, segmented) -> None:
    out = every_camera["kitti-object"]
    lines = [line.split(",") for line in (out / "frames.csv").read_text().splitlines()[1:]]
    assert [line[4] for line in lines] == CAMERAS * 13
    assert [line[0] for line in lines] == [f"{n:06d}" for n in range(39)]
    assert (out / "ImageSets/train.txt").read_text().split() == [line[0] for line in lines]
    rows = Dataset(segmented).episodes[0].camera_objects().to_pylist()
    compared = 0
    for name, _, k, _, camera in lines:
        matrices = calibration(out / f"training/calib/{name}.txt")
        cloud = np.fromfile(out / f"training/velodyne/{name}.bin", np.float32).reshape(-1, 4)
        for line in (out / f"training/label_2/{name}.txt").read_text().splitlines():
            if line.startswith("DontCare"):
                continue
            box = [float(value) for value in line.split()[8:]]
            (seen,) = [
                r for r in rows
                if (r["k"], r["sensor_id"]) == (int(k), camera)
                and r["location"] is not None and abs(r["depth_center"] - box[5]) < 1e-4
            ]  # fmt: skip
            uv = pixels(corners(box), matrices["P2"])
            found = [*uv.min(axis=0), *uv.max(axis=0)]
            # CAM_LEFT looks down, and KITTI's boxes turn about the camera's y axis alone.
            near_px = 3.0 if camera == "CAM_LEFT" else 1.0
            np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=near_px)
            # The points of the camera's own car lie in the box as well.
            optical = np.column_stack([cloud[:, :3], np.ones(len(cloud))]) @ (
                matrices["Tr_velo_to_cam"].T
            )
            low, high = corners(box).min(axis=0) - 0.05, corners(box).max(axis=0) + 0.05
            if ((optical > low) & (optical < high)).all(axis=1).sum() > 3:
                compared += camera == "CAM_AUDI"
    assert compared >= 13


def test_the_other_car_sees_the_ego(every_camera, segmented) -> None:
    rows = Dataset(segmented).episodes[0].camera_objects().to_pylist()
    for n, camera in enumerate(CAMERAS):
        lines = (every_camera["kitti-object"] / f"training/label_2/{n:06d}.txt").read_text()
        seen = [r for r in rows if (r["k"], r["sensor_id"]) == (0, camera) and r["visible"]]
        assert len(lines.splitlines()) == len(seen)


def test_every_camera_is_a_sequence_of_tracking(every_camera) -> None:
    out = every_camera["kitti-tracking"]
    lines = (out / "sequences.csv").read_text().splitlines()
    assert lines[0] == "sequence,episode_id,camera"
    assert [line.split(",")[::2] for line in lines[1:]] == [
        [f"{n:04d}", camera] for n, camera in enumerate(CAMERAS)
    ]
    for n, camera in enumerate(CAMERAS):
        assert len(list((out / f"training/image_02/{n:04d}").iterdir())) == 13
        assert (out / f"training/label_02/{n:04d}.txt").read_text()
        assert "P2:" in (out / f"training/calib/{n:04d}.txt").read_text()
        # Only the ego's own motion is recorded.
        inertial = (out / f"training/oxts/{n:04d}.txt").read_text().splitlines()
        assert len(inertial) == (0 if camera == "CAM_AUDI" else 13)


def test_several_cameras_may_be_named(dataset, tmp_path: Path) -> None:
    options = ExportOptions(cameras=("CAM_LEFT", "CAM_FRONT"))
    export_dataset("kitti-object", dataset, tmp_path / "out", options, workers=0)
    lines = (tmp_path / "out/frames.csv").read_text().splitlines()[1:]
    assert [line.split(",")[4] for line in lines] == ["CAM_LEFT", "CAM_FRONT"] * 6


def test_cameras_on_no_car_show_the_ego_as_one_of_the_cars(watched, tmp_path: Path) -> None:
    export_dataset("kitti-object", watched, tmp_path / "out", workers=0)
    episode = Dataset(watched).episodes[0]
    (seen,) = [
        row
        for row in episode.camera_objects().to_pylist()
        if (row["k"], row["track_id"]) == (1, episode.document["ego_id"])
    ]
    x0, y0, x1, y1 = seen["bbox_modal"]
    lines = (tmp_path / "out/training/label_2/000001.txt").read_text().splitlines()
    boxes = {(name, *map(float, values[3:7])) for name, *values in map(str.split, lines)}
    assert ("Car", x0, y0, x1 - 1, y1 - 1) in boxes
