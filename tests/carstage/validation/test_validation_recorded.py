"""What a simulator recorded is valid without a warning; each kind of damage to it is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.dataset import Dataset
from carstage.dataset.tables import read_table
from carstage.validation import ValidationReport, validate_dataset
from carstage_sim.maps import load_town
from damage import Damage, document, flow_fields, pictures, sweeps
from recorded_dataset import FRAMES, linked_copy, replace_file

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("recorded")]

Rows = list[dict[str, Any]]


@pytest.fixture
def drive(recorded: Path, tmp_path: Path) -> Path:
    """The first of the two drives, to be damaged."""
    return linked_copy(recorded, tmp_path / "out", episodes=1)


def found(report: ValidationReport, severity: str) -> set[str]:
    return {problem.check for problem in report.problems if problem.severity == severity}


def files(drive: Path, sensor: str) -> list[Path]:
    """The files of a sensor by frame (of an instance camera those of the ids)."""
    return sorted((attempt_of(drive) / "sensors" / sensor).glob("[0-9]*[0-9].[a-z]*"))


def test_two_drives_in_a_town_share_the_text_that_its_client_gets(recorded: Path) -> None:
    (kept,) = (recorded / "maps").glob("*.xodr")
    assert kept.read_bytes().decode() == load_town("Stage01").opendrive
    assert {episode.map_file for episode in Dataset(recorded).episodes} == {kept}


def test_what_was_recorded_is_valid_without_a_warning(recorded: Path) -> None:
    report = validate_dataset(recorded)
    assert report.problems == ()
    figures = report.figures
    assert figures["frames"] == 2 * FRAMES
    assert figures["hull"]["pixels"] > 10_000
    assert figures["flow"]["FLOW_FRONT"]["pixels"] > 2000
    assert figures["flow"]["FLOW_FRONT"]["share"] > 0.99
    assert figures["motion"]["share"] > 0.99
    assert figures["rgb_frame"]["CAM_FRONT"]["-1"] > 1.2
    assert figures["rgb_frame"]["CAM_FRONT"]["1"] > 1.2
    assert figures["labels"]["visible_vehicle_labels"] > 20


def flip_a_byte(drive: Path) -> None:
    path = files(drive, "DEPTH_FRONT")[3]
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    replace_file(path, bytes(content))


def drop_a_file(drive: Path) -> None:
    files(drive, "LIDAR_TOP")[2].unlink()


def drop_a_file_and_commit_again(drive: Path) -> None:
    drop_a_file(drive)
    recommit(drive)


def shift_all_labels_by_a_frame(drive: Path) -> None:
    for name in ("objects", "camera_objects", "ego"):
        edit_rows(drive, f"{name}.parquet", _rows_of_the_frame_after)


def _rows_of_the_frame_after(rows: Rows) -> Rows:
    times = {row["k"]: row["timestamp_s"] for row in rows}
    return [
        {**row, "k": row["k"] - 1, "timestamp_s": times[row["k"] - 1]} for row in rows if row["k"]
    ]


def shift_colour_images_by_a_frame(drive: Path) -> None:
    paths = files(drive, "CAM_FRONT")
    contents = [path.read_bytes() for path in paths]
    for path, content in zip(paths, [contents[0], *contents[:-1]], strict=True):
        replace_file(path, content)
    recommit(drive)


def swap_sensors(drive: Path, first: str, second: str) -> None:
    sensors = attempt_of(drive) / "sensors"
    (sensors / first).rename(sensors / "between")
    (sensors / second).rename(sensors / first)
    (sensors / "between").rename(sensors / second)
    recommit(drive)


def swap_cameras(drive: Path) -> None:
    swap_sensors(drive, "CAM_FRONT", "CAM_LEFT")


def swap_depth_and_colour(drive: Path) -> None:
    """Both are 8-bit RGB PNG files of one size."""
    swap_sensors(drive, "CAM_FRONT", "DEPTH_FRONT")


def mirror_boxes(drive: Path) -> None:
    """In both frames, so that they agree with each other."""

    def edit(rows: Rows) -> Rows:
        for row in rows:
            if not row["is_ego"] and row["box_center_ego"] is not None:
                x, y, z = row["box_center_ego"]
                pitch, yaw, roll = row["box_rotation_ego_deg"]
                row["box_center_ego"] = [x, -y, z]
                row["box_rotation_ego_deg"] = [pitch, -yaw, -roll]
        return rows

    edit_rows(drive, "objects.parquet", edit)
    edit_rows(drive, "ego.parquet", lambda rows: [])
    document = attempt_of(drive) / "episode.json"
    content = json.loads(document.read_text())
    content["spec"]["ground_truth"]["ego_motion"] = False
    document.write_text(json.dumps(content))
    recommit(drive)


mirror_sweeps = sweeps(lambda points: np.negative(points[:, 1], out=points[:, 1]))
scale_sweeps = sweeps(lambda points: np.multiply(points[:, :3], 1.03, out=points[:, :3]))


def drop_rows_of_an_object(drive: Path) -> None:
    """In one frame, from both tables, so that no row refers to nothing."""
    rows = read_table(attempt_of(drive) / "camera_objects.parquet").to_pylist()
    track = next(row["track_id"] for row in rows if row["k"] == 4 and row["visible"])

    def edit(rows: Rows) -> Rows:
        return [row for row in rows if (row["k"], row["track_id"]) != (4, track)]

    edit_rows(drive, "objects.parquet", edit)
    edit_rows(drive, "camera_objects.parquet", edit)


def drop_rows_of_a_camera(drive: Path) -> None:
    def edit(rows: Rows) -> Rows:
        return [row for row in rows if (row["k"], row["sensor_id"]) != (4, "CAM_FRONT")]

    edit_rows(drive, "camera_objects.parquet", edit)


def drop_rows_of_the_ego(drive: Path) -> None:
    edit_rows(drive, "objects.parquet", lambda rows: [r for r in rows if not r["is_ego"]])


def shift_timestamps(drive: Path) -> None:
    """All tables alike: only what was asked for tells."""
    tables = ["frames", "objects", "camera_objects", "ego", "sensor_poses"]
    for name in (*tables, "sensors/IMU", "sensors/GNSS", "sensors/RADAR_FRONT"):
        edit_rows(
            drive,
            f"{name}.parquet",
            lambda rows: [{**row, "timestamp_s": row["timestamp_s"] + 0.05} for row in rows],
        )


def widen_a_camera(drive: Path) -> None:
    def edit(sensors: dict[str, Any]) -> None:
        sensors["CAM_FRONT"]["K"][0][0] *= 1.05
        sensors["CAM_FRONT"]["K"][1][1] *= 1.05

    document("calibration.json", lambda content: edit(content["sensors"]))(drive)


def move_the_lidar(drive: Path) -> None:
    def edit(sensors: dict[str, Any]) -> None:
        sensors["LIDAR_TOP"]["ego_from_sensor"][1][3] += 0.5

    document("calibration.json", lambda content: edit(content["sensors"]))(drive)


def turn_a_depth_camera(drive: Path) -> None:
    def edit(sensors: dict[str, Any]) -> None:
        c, s = np.cos(0.05), np.sin(0.05)
        turned = np.array([[c, -s, 0, 1.5], [s, c, 0, 0], [0, 0, 1, 1.6], [0, 0, 0, 1.0]])
        sensors["DEPTH_FRONT"]["ego_from_sensor"] = turned.tolist()

    document("calibration.json", lambda content: edit(content["sensors"]))(drive)


negate_flow = flow_fields(np.negative)
forget_flow = flow_fields(np.zeros_like)
mirror_tags = pictures("SEMANTIC_FRONT", lambda tags: np.ascontiguousarray(tags[:, ::-1]))


def freeze_the_picture(drive: Path) -> None:
    first, *others = files(drive, "CAM_LEFT")
    for path in others:
        replace_file(path, first.read_bytes())
    recommit(drive)


def turn_the_radar(drive: Path) -> None:
    """What it found lies behind the ego then, and in other boxes."""

    def turned(rows: Rows) -> Rows:
        return [{**row, "azimuth_rad": [a + 3.0 for a in row["azimuth_rad"]]} for row in rows]

    edit_rows(drive, "sensors/RADAR_FRONT.parquet", turned)


def lose_a_number_of_the_radar(drive: Path) -> None:
    def shortened(rows: Rows) -> Rows:
        return [{**row, "depth_m": row["depth_m"][1:]} for row in rows]

    edit_rows(drive, "sensors/RADAR_FRONT.parquet", shortened)


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (flip_a_byte, {"file_hash"}),
        (drop_a_file, {"file_missing"}),
        (drop_a_file_and_commit_again, {"file_unlisted"}),
        (shift_all_labels_by_a_frame, {"mask", "lidar_counts"}),
        (shift_colour_images_by_a_frame, {"rgb_frame"}),
        (swap_cameras, {"rgb_edges"}),
        (swap_depth_and_colour, {"lidar_depth"}),
        (mirror_boxes, {"hull", "bbox_amodal", "lidar_counts"}),
        (mirror_sweeps, {"lidar_depth", "lidar_counts"}),
        (scale_sweeps, {"lidar_depth"}),
        (turn_the_radar, {"radar_counts"}),
        (lose_a_number_of_the_radar, {"schema"}),
        (drop_rows_of_an_object, {"label_gaps"}),
        (drop_rows_of_a_camera, {"label_missing"}),
        (drop_rows_of_the_ego, {"label_gaps"}),
        (shift_timestamps, {"timestamps"}),
        (widen_a_camera, {"bbox_amodal"}),
        (move_the_lidar, {"lidar_depth"}),
        (turn_a_depth_camera, {"lidar_depth"}),
        (negate_flow, {"flow"}),
        (forget_flow, {"flow"}),
        (mirror_tags, {"tags"}),
        (freeze_the_picture, {"repeated"}),
    ],
)
def test_damage_is_named(drive: Path, damage: Damage, expected: set[str]) -> None:
    damage(drive)
    report = validate_dataset(drive)
    assert not report.ok
    assert expected <= found(report, "error")
    for name in expected:
        assert report.counts[name]["error"] > 0


def fill_pictures(value: int) -> Damage:
    return pictures("CAM_LEFT", lambda _: np.full((90, 160, 3), value, np.uint8))


def hold_everybody(drive: Path) -> None:
    first: dict[int, list[float]] = {}

    def edit(rows: Rows) -> Rows:
        for row in rows:
            row["actor_location"] = first.setdefault(row["track_id"], row["actor_location"])
        return rows

    edit_rows(drive, "objects.parquet", edit)
    document = attempt_of(drive) / "episode.json"  # a drive of a second says nothing
    content = json.loads(document.read_text())
    content["spec"]["fps"] = 2.0
    content["spec"]["timing"]["max_substeps"] = 50
    document.write_text(json.dumps(content))
    recommit(drive)


def hide(walkers: bool) -> Damage:
    def edit_all(drive: Path) -> None:
        objects = read_table(attempt_of(drive) / "objects.parquet").to_pylist()
        chosen = {r["track_id"] for r in objects if r["class"].startswith("walker") == walkers}

        def edit(rows: Rows) -> Rows:
            for row in rows:
                row["visible"] = row["visible"] and row["track_id"] not in chosen
            return rows

        edit_rows(drive, "camera_objects.parquet", edit)

    return edit_all


def occlude_everything(drive: Path) -> None:
    edit_rows(
        drive, "camera_objects.parquet", lambda rows: [{**row, "occluded_px": 2} for row in rows]
    )


def lose_half_of_the_crowd(drive: Path) -> None:
    document = attempt_of(drive) / "episode.json"
    content = json.loads(document.read_text())
    content["spawned"]["pedestrians"] //= 2
    document.write_text(json.dumps(content))
    recommit(drive)


def see_nobody(drive: Path) -> None:
    hide(walkers=True)(drive)
    hide(walkers=False)(drive)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (fill_pictures(0), "exposure"),
        (fill_pictures(255), "exposure"),
        (fill_pictures(120), "exposure"),
        (hold_everybody, "frozen_traffic"),
        (hold_everybody, "ego_still"),
        (hide(walkers=True), "no_pedestrians"),
        (hide(walkers=False), "no_vehicles"),
        (see_nobody, "no_objects"),
        (occlude_everything, "all_occluded"),
        (lose_half_of_the_crowd, "population"),
    ],
)
def test_a_suspicious_set_is_warned_of(drive: Path, change: Damage, expected: str) -> None:
    change(drive)
    report = validate_dataset(drive)
    assert report.counts[expected]["warning"] > 0
    assert expected in found(report, "warning")


def test_an_episode_that_is_there_twice_is_warned_of(recorded: Path, tmp_path: Path) -> None:
    copy = linked_copy(recorded, tmp_path / "out", episodes=1)
    (marker,) = (copy / "commits").glob("*.json")
    content = json.loads(marker.read_text())
    twin = "f" * 16
    (copy / "episodes" / twin).symlink_to(attempt_of(copy).parent)
    (copy / "commits" / f"{twin}.json").write_text(json.dumps({**content, "episode_id": twin}))
    report = validate_dataset(copy)
    assert "repeated_episode" in found(report, "warning")
