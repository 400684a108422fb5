"""An undamaged dataset is valid; each kind of damage is found, by a check that names it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import analytic_dataset
from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.annotation.rle import encode_mask
from carstage.cli.app import app
from carstage.codecs.png import PngPacker, unpack_png
from carstage.dataset import Dataset
from carstage.dataset.masks import decode_mask
from carstage.dataset.tables import read_table, write_table
from carstage.errors import DatasetError
from carstage.files.hashing import hash_of
from carstage.validation import validate_dataset

Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    return analytic_dataset.make_dataset(folder / "out", folder)


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def failed_checks(dataset: Path) -> set[str]:
    report = validate_dataset(dataset)
    errors = {problem.check for problem in report.problems if problem.severity == "error"}
    assert report.ok == (not errors)
    return errors


def sensor_file(dataset: Path, sensor: str, k: int, ending: str) -> Path:
    return attempt_of(dataset) / "sensors" / sensor / f"{k:06d}{ending}"


def test_an_undamaged_dataset_is_valid_and_its_figures_say_what_was_compared(whole: Path) -> None:
    progress: list[tuple[int, int]] = []
    report = validate_dataset(whole, progress=lambda *done: progress.append(done))
    assert report.ok
    assert report.problems == ()
    assert progress == [(5, 6), (6, 6)]
    figures = json.loads(report.to_json())["figures"]
    assert (figures["episodes"], figures["frames"], figures["files"]) == (1, 6, 6 * 7 + 9)
    assert figures["hull"]["pixels"] > 5000
    assert figures["hull"]["pixels_outside"] == 0
    pair = figures["lidar_depth"]["LIDAR_TOP / DEPTH_FRONT"]
    assert pair["points_comparable"] > 2000
    assert pair["share"] >= 0.99
    assert figures["lidar_points_in_boxes"] > 100


@pytest.mark.parametrize(
    "name",
    ["episode.json", "frames.parquet", "objects.parquet", "sensors/IMU.parquet",
     "sensors/CAM_FRONT/000002.png", "sensors/INST_FRONT/000001.tag.png",
     "sensors/LIDAR_TOP/000004.bin"],
)  # fmt: skip
def test_a_flipped_byte_is_found_in_any_file(dataset: Path, name: str) -> None:
    path = attempt_of(dataset) / name
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 0x10
    path.write_bytes(bytes(content))
    assert "file_hash" in failed_checks(dataset)


def test_a_missing_file_is_named(dataset: Path) -> None:
    sensor_file(dataset, "DEPTH_FRONT", 3, ".png").unlink()
    report = validate_dataset(dataset)
    (problem,) = report.problems
    assert (problem.check, problem.frame, problem.sensor) == ("file_missing", 3, "DEPTH_FRONT")
    assert "sensors/DEPTH_FRONT/000003.png" in problem.message


def test_a_missing_file_that_no_marker_lists_is_found_too(dataset: Path) -> None:
    sensor_file(dataset, "CAM_LEFT", 5, ".png").unlink()
    recommit(dataset)
    assert "file_unlisted" in failed_checks(dataset)


def test_a_cut_file_is_found(dataset: Path) -> None:
    path = sensor_file(dataset, "LIDAR_TOP", 0, ".bin")
    path.write_bytes(path.read_bytes()[:-16])
    assert "file_size" in failed_checks(dataset)


def test_a_file_that_does_not_belong_is_a_warning(dataset: Path) -> None:
    (attempt_of(dataset) / "notes.txt").write_text("mine")
    report = validate_dataset(dataset)
    assert report.ok
    assert [problem.check for problem in report.problems] == ["file_unexpected"]


def test_a_map_that_is_lost_or_changed_is_found(dataset: Path) -> None:
    (path,) = (dataset / "maps").iterdir()
    text = path.read_text()
    path.write_text(text.replace("Analytic01", "Analytic02"))
    assert failed_checks(dataset) == {"map"}
    path.unlink()
    assert failed_checks(dataset) == {"map"}
    path.write_text(text)
    assert failed_checks(dataset) == set()


@pytest.mark.parametrize(
    ("named", "text"),
    [
        ("no hash", None),
        ("blake3:../../x", None),
        (7, None),
        (["a"], None),
        (None, "<svg/>"),
        (None, "<!--"),
        (None, "<!---->" * 100_000 + "<svg/>"),
        (None, "\n" * 1_000_000),
    ],
    ids=["word", "path", "number", "list", "svg", "open", "comments", "lines"],
)
def test_what_is_named_as_the_map_has_to_be_one(
    dataset: Path, named: object, text: str | None
) -> None:
    if text is not None:
        named = hash_of(text.encode())
        (dataset / "maps" / f"{str(named).partition(':')[2]}.xodr").write_text(text)
    path = attempt_of(dataset) / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"opendrive": named}))
    recommit(dataset)
    assert failed_checks(dataset) == {"map"}


def test_a_map_that_is_not_the_one_that_was_asked_for_is_found(dataset: Path) -> None:
    path = attempt_of(dataset) / "episode.json"
    document = json.loads(path.read_text())
    for wanted, found in ((document["opendrive"], set()), (f"blake3:{0:064x}", {"map"})):
        spec = {**document["spec"], "opendrive": wanted}
        path.write_text(json.dumps({**document, "spec": spec}))
        recommit(dataset)
        assert failed_checks(dataset) - {"episode_id"} == found


def test_comments_and_a_declaration_may_stand_before_the_map(dataset: Path) -> None:
    (kept,) = (dataset / "maps").iterdir()
    _, _, root = kept.read_text().partition("<OpenDRIVE")
    text = f"<?xml version='1.0'?>\n<!-- a --> <!-- b -->\n<OpenDRIVE{root}"
    named = hash_of(text.encode())
    (dataset / "maps" / f"{named.partition(':')[2]}.xodr").write_text(text)
    path = attempt_of(dataset) / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"opendrive": named}))
    recommit(dataset)
    assert failed_checks(dataset) == set()


def test_an_episode_without_a_map_is_valid(dataset: Path) -> None:
    """Datasets of version 0.1 have none."""
    path = attempt_of(dataset) / "episode.json"
    document = json.loads(path.read_text())
    del document["opendrive"]
    path.write_text(json.dumps(document))
    recommit(dataset)
    shutil.rmtree(dataset / "maps")
    assert failed_checks(dataset) == set()


def test_an_image_that_does_not_decode_is_found(dataset: Path) -> None:
    path = sensor_file(dataset, "SEM_FRONT", 1, ".png")
    path.write_bytes(path.read_bytes()[:60])
    recommit(dataset)
    assert failed_checks(dataset) == {"decode"}


def test_an_image_of_another_size_is_found(dataset: Path) -> None:
    path = sensor_file(dataset, "CAM_FRONT", 1, ".png")
    path.write_bytes(PngPacker().pack(np.zeros((10, 12, 3), np.uint8)))
    recommit(dataset)
    assert failed_checks(dataset) == {"image_size"}


def shifted(rows: Rows) -> Rows:
    """Every row with the content of the row one frame later."""
    by_key = {(r["k"], r.get("sensor_id"), r["track_id"]): r for r in rows}
    moved = []
    for row in rows:
        source = by_key.get((row["k"] + 1, row.get("sensor_id"), row["track_id"]), row)
        moved.append({**source, "k": row["k"], "timestamp_s": row["timestamp_s"]})
    return moved


def test_objects_shifted_by_a_frame_are_found(dataset: Path) -> None:
    edit_rows(dataset, "objects.parquet", shifted)
    assert {"hull", "label_poses", "lidar_counts"} <= failed_checks(dataset)


def test_all_labels_shifted_by_a_frame_are_found(dataset: Path) -> None:
    for table in ("objects.parquet", "camera_objects.parquet", "ego.parquet"):
        edit_rows(dataset, table, shifted)
    assert {"hull", "lidar_counts", "mask"} <= failed_checks(dataset)


def mirrored(*columns: str) -> Callable[[Rows], Rows]:
    def edit(rows: Rows) -> Rows:
        for row in rows:
            for column in columns:
                x, y, z = row[column]
                row[column] = [x, -y, z]
        return rows

    return edit


def test_boxes_mirrored_in_the_world_are_found(dataset: Path) -> None:
    edit_rows(dataset, "objects.parquet", mirrored("box_center"))
    assert {"hull", "label_poses", "bbox_amodal", "lidar_counts"} <= failed_checks(dataset)


def test_boxes_mirrored_in_the_ego_frame_are_found(dataset: Path) -> None:
    edit_rows(dataset, "objects.parquet", mirrored("box_center_ego"))
    assert failed_checks(dataset) == {"label_poses", "object_columns"}


def test_mirrored_lidar_points_are_found(dataset: Path) -> None:
    for k in range(6):
        path = sensor_file(dataset, "LIDAR_TOP", k, ".bin")
        points = np.fromfile(path, "<f4").reshape(-1, 4)
        points[:, 1] *= -1
        points.tofile(path)
    recommit(dataset)
    assert {"lidar_depth", "lidar_counts"} <= failed_checks(dataset)


@pytest.mark.parametrize("scale", [0.93, 1.07])
def test_lidar_ranges_with_a_wrong_scale_are_found(dataset: Path, scale: float) -> None:
    for k in range(6):
        path = sensor_file(dataset, "LIDAR_TOP", k, ".bin")
        points = np.fromfile(path, "<f4").reshape(-1, 4)
        points[:, :3] *= scale
        points.tofile(path)
    recommit(dataset)
    assert "lidar_depth" in failed_checks(dataset)


def test_the_sweep_of_another_frame_is_found(dataset: Path) -> None:
    shutil.copy(
        sensor_file(dataset, "LIDAR_TOP", 5, ".bin"), sensor_file(dataset, "LIDAR_TOP", 0, ".bin")
    )
    recommit(dataset)
    assert "lidar_counts" in failed_checks(dataset)


def test_colour_images_of_swapped_cameras_are_found(dataset: Path) -> None:
    sensors = attempt_of(dataset) / "sensors"
    (sensors / "CAM_FRONT").rename(sensors / "CAM")
    (sensors / "CAM_LEFT").rename(sensors / "CAM_FRONT")
    (sensors / "CAM").rename(sensors / "CAM_LEFT")
    recommit(dataset)
    assert "rgb_edges" in failed_checks(dataset)


def test_labels_of_swapped_cameras_are_found(dataset: Path) -> None:
    other = {"CAM_FRONT": "CAM_LEFT", "CAM_LEFT": "CAM_FRONT"}
    edit_rows(
        dataset,
        "camera_objects.parquet",
        lambda rows: [{**row, "sensor_id": other[row["sensor_id"]]} for row in rows],
    )
    assert {"bbox_amodal", "hull"} & failed_checks(dataset)


def test_swapped_poses_in_the_calibration_are_found(dataset: Path) -> None:
    path = attempt_of(dataset) / "calibration.json"
    document = json.loads(path.read_text())
    sensors = document["sensors"]
    front, left = sensors["CAM_FRONT"], sensors["CAM_LEFT"]
    for key in ("ego_from_sensor",):
        front[key], left[key] = left[key], front[key]
    path.write_text(json.dumps(document))
    recommit(dataset)
    assert {"bbox_amodal", "hull"} & failed_checks(dataset)


def test_mirrored_instance_images_are_found(dataset: Path) -> None:
    for k in range(6):
        for ending in (".png", ".tag.png"):
            path = sensor_file(dataset, "INST_FRONT", k, ending)
            path.write_bytes(PngPacker().pack(unpack_png(path.read_bytes())[:, ::-1]))
    recommit(dataset)
    assert {"hull", "mask"} <= failed_checks(dataset)


def test_a_mask_that_misses_half_of_its_object_is_found(dataset: Path) -> None:
    def halve(rows: Rows) -> Rows:
        row = max(
            (r for r in rows if r["sensor_id"] == "CAM_FRONT" and r["mask_modal"] is not None),
            key=lambda r: r["visible_px"],
        )
        x0, y0, x1, y1 = (int(value) for value in row["bbox_modal"])
        camera = Dataset(dataset).episodes[0].sensor("CAM_FRONT").calibration
        size = camera.height, camera.width
        crop = decode_mask(row["mask_modal"], *size)[y0:y1, x0 : (x0 + x1) // 2]
        v, u = np.nonzero(crop)
        row["mask_modal"] = encode_mask(crop, x0, y0, camera.width, camera.height)
        row["visible_px"] = len(u)
        row["bbox_modal"] = [x0 + u.min(), y0 + v.min(), x0 + u.max() + 1, y0 + v.max() + 1]
        return rows

    edit_rows(dataset, "camera_objects.parquet", halve)
    messages = [problem.message for problem in validate_dataset(dataset).problems]
    assert any("the instance picture shows" in message for message in messages)


def test_a_damaged_mask_of_a_painted_vehicle_is_one_problem(dataset: Path) -> None:
    """Its pixels tell the order of colours; all else of the episode is checked still."""
    path = attempt_of(dataset) / "episode.json"
    document = json.loads(path.read_text())
    for actor in document["actors"].values():
        actor["attributes"]["color"] = "200,10,10"
    path.write_text(json.dumps(document))

    def edit(rows: Rows) -> Rows:
        row = next(r for r in rows if r["sensor_id"] == "CAM_FRONT" and r["mask_modal"] is not None)
        row["mask_modal"] = "0"
        return rows

    edit_rows(dataset, "camera_objects.parquet", edit)
    assert failed_checks(dataset) == {"mask"}


@pytest.mark.parametrize("ambiguous", [False, True])
def test_pixels_of_another_thing_with_that_id_are_no_error_where_labels_say_so(
    dataset: Path, ambiguous: bool
) -> None:
    """An instance image holds 16 bits of an id; a parked car may carry those of an actor."""
    rows = read_table(attempt_of(dataset) / "camera_objects.parquet").to_pylist()
    row = next(r for r in rows if r["sensor_id"] == "CAM_FRONT" and r["mask_modal"] is not None)
    ids, tags = (
        sensor_file(dataset, "INST_FRONT", row["k"], ending) for ending in (".png", ".tag.png")
    )
    x0, y0, *_ = (int(value) for value in row["bbox_modal"])
    image, tag = unpack_png(ids.read_bytes()).copy(), unpack_png(tags.read_bytes()).copy()
    own = image == row["track_id"]
    far = (0, 0) if x0 > 20 or y0 > 20 else (-1, -1)
    image[far], tag[far] = row["track_id"], tag[own][0]
    ids.write_bytes(PngPacker().pack(image))
    tags.write_bytes(PngPacker().pack(tag))

    def mark(rows: Rows) -> Rows:
        return [{**r, "instance_ambiguous": ambiguous and r["track_id"] < 1 << 52} for r in rows]

    edit_rows(dataset, "camera_objects.parquet", mark)
    assert failed_checks(dataset) == (set() if ambiguous else {"hull"})


@pytest.mark.parametrize(
    ("table", "column", "value", "check"),
    [
        ("camera_objects.parquet", "truncated", 1.5, "label_ranges"),
        ("camera_objects.parquet", "rotation_y", 4.0, "label_ranges"),
        ("camera_objects.parquet", "n_visible", 7, "label_ranges"),
        ("camera_objects.parquet", "track_id", 999, "label_references"),
        ("camera_objects.parquet", "bbox_modal", [0.0, 0.0, 5.0, 5.0], "mask"),
        ("camera_objects.parquet", "bbox_amodal", [0.0, 0.0, 5.0, 5.0], "bbox_amodal"),
        ("camera_objects.parquet", "visible_px", 3, "mask"),
        ("camera_objects.parquet", "mask_modal", "0", "mask"),
        ("camera_objects.parquet", "timestamp_s", 9.0, "label_timestamps"),
        ("objects.parquet", "num_lidar_points", [("LIDAR_TOP", 4000)], "lidar_counts"),
        ("objects.parquet", "num_radar_points", [("RADAR_LEFT", 4)], "label_references"),
        ("objects.parquet", "timestamp_s", 9.0, "label_timestamps"),
        ("objects.parquet", "visibility", -0.1, "label_ranges"),
        ("ego.parquet", "steer", -2.0, "label_ranges"),
        ("ego.parquet", "k", 1, "frames_missing"),
        ("frames.parquet", "timestamp_s", 0.004, "timestamps"),
        ("frames.parquet", "server_frame", 4, "server_frames"),
        ("frames.parquet", "CAM_FRONT.state", "late", "ledger_state"),
        ("frames.parquet", "k", None, "frames_missing"),
        ("sensors/IMU.parquet", "timestamp_s", 0.05, "timestamps"),
        ("sensors/GNSS.parquet", "k", 3, "frames_missing"),
    ],
)
def test_a_wrong_value_in_a_table_is_found(
    dataset: Path, table: str, column: str, value: object, check: str
) -> None:
    def edit(rows: Rows) -> Rows:
        rows[0][column] = value
        return rows

    edit_rows(dataset, table, edit)
    assert check in failed_checks(dataset)


def test_a_corner_that_is_lost_ahead_of_its_camera_is_found(dataset: Path) -> None:
    def edit(rows: Rows) -> Rows:
        row = next(r for r in rows if r["depth_center"] > 8.0 and None not in r["corners_uv"])
        row["corners_uv"][3] = None
        return rows

    edit_rows(dataset, "camera_objects.parquet", edit)
    assert failed_checks(dataset) == {"camera_columns"}


def test_a_missing_row_of_a_row_sensor_is_found(dataset: Path) -> None:
    edit_rows(dataset, "sensors/IMU.parquet", lambda rows: rows[:-1])
    assert failed_checks(dataset) == {"frames_missing"}


def test_missing_ticks_are_found(dataset: Path) -> None:
    edit_rows(dataset, "frames.parquet", lambda rows: rows[:-1])
    assert {"ledger_ticks", "frames_missing"} <= failed_checks(dataset)


def test_missing_data_is_a_warning_where_skipping_was_declared(dataset: Path) -> None:
    document = attempt_of(dataset) / "episode.json"
    document.write_text(document.read_text().replace('"wait"', '"skip"'))
    sensor_file(dataset, "CAM_LEFT", 2, ".png").unlink()

    def edit(rows: Rows) -> Rows:
        rows[2] |= {"CAM_LEFT.state": "missing", "CAM_LEFT.reason": "no data within 2 s"}
        return rows

    edit_rows(dataset, "frames.parquet", edit)
    report = validate_dataset(dataset)
    assert report.ok
    (problem,) = report.problems
    assert (problem.check, problem.severity, problem.sensor) == (
        "ledger_state", "warning", "CAM_LEFT",
    )  # fmt: skip
    assert "no data within 2 s" in problem.message


def test_a_sensor_that_measured_in_no_saved_frame_is_warned_of(dataset: Path) -> None:
    edit_rows(
        dataset, "frames.parquet", lambda rows: [{**row, "GNSS.state": "off"} for row in rows]
    )
    edit_rows(dataset, "sensors/GNSS.parquet", lambda rows: [])
    report = validate_dataset(dataset)
    assert report.ok
    (problem,) = report.problems
    assert (problem.check, problem.severity, problem.sensor) == ("ledger_state", "warning", "GNSS")


def test_an_unreadable_episode_is_one_problem_and_no_crash(dataset: Path) -> None:
    (attempt_of(dataset) / "calibration.json").write_text("{")
    recommit(dataset)
    assert failed_checks(dataset) == {"unreadable"}


@pytest.mark.parametrize(
    ("table", "column"),
    [
        ("frames.parquet", "k"),
        ("frames.parquet", "CAM_LEFT.state"),
        ("objects.parquet", "box_center_ego"),
        ("objects.parquet", "timestamp_s"),
        ("camera_objects.parquet", "mask_modal"),
        ("camera_objects.parquet", "n_behind"),
        ("camera_objects.parquet", "alpha"),
        ("ego.parquet", "location"),
    ],
)
def test_a_missing_column_is_named_and_no_crash(dataset: Path, table: str, column: str) -> None:
    path = attempt_of(dataset) / table
    write_table(read_table(path).drop_columns([column]), path)
    recommit(dataset)
    report = validate_dataset(dataset)
    (problem,) = report.problems
    assert problem.check == "unreadable"
    assert f"{table} has no column {column}" in problem.message


def test_much_of_one_damage_is_listed_up_to_a_limit_and_counted(dataset: Path) -> None:
    edit_rows(
        dataset,
        "camera_objects.parquet",
        lambda rows: [{**row, "timestamp_s": 9.0} for row in [*rows, *rows]],
    )
    report = validate_dataset(dataset)
    listed = [p for p in report.problems if p.check == "label_timestamps"]
    assert len(listed) == 26
    assert "more of this kind" in listed[-1].message


def test_a_dataset_without_episodes_is_not_valid(dataset: Path) -> None:
    next((dataset / "commits").glob("*.json")).unlink()
    assert failed_checks(dataset) == {"empty"}


def test_the_command_writes_its_verdict_as_a_page(whole: Path, tmp_path: Path) -> None:
    page, nowhere = tmp_path / "verdict.html", tmp_path / "none" / "verdict.html"
    ended = CliRunner().invoke(app, ["validate", str(whole), "--html", str(page)])
    assert ended.exit_code == 0
    assert "No problem was found" in page.read_text("utf-8")
    assert CliRunner().invoke(app, ["validate", str(whole), "--html", str(nowhere)]).exit_code == 2


def test_a_folder_that_is_no_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no dataset\.json"):
        validate_dataset(tmp_path)


def test_check_that_the_server_failed_before_the_run_is_a_warning(dataset: Path) -> None:
    (path,) = (dataset / "commits").glob("*.json")
    marker = json.loads(path.read_bytes())
    checks = [
        {"name": "frames", "ok": True, "found": "every frame", "expected": "every frame"},
        {"name": "LiDAR axes", "ok": False, "found": "y left", "expected": "y right"},
    ]
    marker["self_test"] = {"ok": False, "server": "0.10.0", "checks": checks}
    path.write_text(json.dumps(marker))
    report = validate_dataset(dataset)
    assert report.ok
    (problem,) = report.problems
    assert (problem.check, problem.severity) == ("self_test", "warning")
    assert "LiDAR axes: y left; expected: y right" in problem.message
