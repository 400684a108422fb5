"""MCAP exports with Foxglove's messages, read by the mcap package."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.dataset import Dataset, Episode
from carstage.exporters import ClassMap, ExportOptions, export_dataset
from carstage.exporters.formats.mcap_contents import CONTENTS
from carstage.geometry import GeoFrame, pose_matrix
from carstage.sensor_kinds import sensor_kind, table
from carstage.sensor_kinds.built_in import BUILT_IN
from carstage.sensor_kinds.model import CAMERAS, CLOUDS, ROWS
from carstage.tags import tag_table
from mcap_reading import Messages, foxglove_messages, pixels, pose, ros2_messages, vector

pytest.importorskip("mcap", reason="the extra mcap is not installed")

pytestmark = pytest.mark.xdist_group("export")
MIRROR = np.array([1.0, -1.0, 1.0])
K = 3


def exported_messages(dataset: Path, out: Path, **choices: Any) -> Messages:
    export_dataset("mcap", dataset, out, ExportOptions(**choices), workers=0)
    (path,) = out.glob("*.mcap")
    return foxglove_messages(path)


@pytest.fixture(scope="module")
def messages(exported: Callable[..., Path]) -> Messages:
    (path,) = exported("mcap").glob("*.mcap")
    return foxglove_messages(path)


@pytest.fixture(scope="module")
def of_every_kind(every_kind: Path, tmp_path_factory: pytest.TempPathFactory) -> Messages:
    return exported_messages(every_kind, tmp_path_factory.mktemp("export") / "out")


@pytest.fixture(scope="module")
def episode(every_kind: Path) -> Episode:
    return Dataset(every_kind).episodes[0]


def test_every_content_that_a_kind_may_have_has_a_message() -> None:
    assert set(CONTENTS) == {*CAMERAS, *CLOUDS, *ROWS}


def test_every_kind_of_sensor_has_a_channel(of_every_kind: Messages, episode: Episode) -> None:
    # Flash LiDARs need depth pictures: tests/carstage/conversion/test_recorded_flash_lidar.py.
    # Radars with cross sections: tests/carstage/conversion/test_recorded_rcs_radar.py.
    # Radios need senders: tests/carstage/runs/test_v2x.py.
    wanted = {k.name for k in BUILT_IN if not k.recorded and not k.is_sparse} - {"rcs_radar"}
    assert {s.kind for s in episode.sensors} == wanted
    for sensor in episode.sensors:
        assert [topic for topic in of_every_kind if topic.startswith(f"/{sensor.id}/")], sensor.id


def test_depth_tags_ids_and_flow_are_the_dataset_s(
    of_every_kind: Messages, episode: Episode
) -> None:
    def picture(topic: str) -> Any:
        return pixels(of_every_kind[topic][K][1])

    np.testing.assert_array_equal(
        picture("/DEPTH_FRONT/image"), episode.sensor("DEPTH_FRONT").read(K)
    )
    tags = episode.sensor("SEM_FRONT").read(K)
    np.testing.assert_array_equal(picture("/SEM_FRONT/image"), tags)
    palette = tag_table("0.9.16")
    car = tags == analytic_scene.CAR
    assert car.any()
    assert (picture("/SEM_FRONT/colors")[car] == palette[analytic_scene.CAR].rgb).all()
    instances = episode.sensor("INST_FRONT").read(K)
    assert len(np.unique(instances[..., 0])) > 2
    np.testing.assert_array_equal(picture("/INST_FRONT/image"), instances[..., 0])
    np.testing.assert_array_equal(picture("/INST_FRONT/tags"), instances[..., 1])
    flow = episode.sensor("FLOW_FRONT").read(K)
    np.testing.assert_array_equal(picture("/FLOW_FRONT/right"), flow[..., 0])
    np.testing.assert_array_equal(picture("/FLOW_FRONT/down"), flow[..., 1])
    normals = of_every_kind["/NORMALS_LEFT/image"][K][1]
    with Image.open(io.BytesIO(normals.data)) as shown:
        np.testing.assert_array_equal(np.asarray(shown), episode.sensor("NORMALS_LEFT").read(K))


def columns(cloud: Any) -> Any:
    types = {7: "<f4", 6: "<u4", 5: "<u4"}  # Foxglove's FLOAT32; UINT32
    kind = np.dtype([(f.name, types[f.type]) for f in cloud.fields])
    assert [f.offset for f in cloud.fields] == [kind.fields[f.name][1] for f in cloud.fields]
    assert cloud.point_stride == kind.itemsize
    return np.frombuffer(cloud.data, kind)


def test_semantic_points_keep_ids_of_32_bits(of_every_kind: Messages, episode: Episode) -> None:
    points = columns(of_every_kind["/SEMLIDAR_TOP/points"][K][1])
    own = episode.sensor("SEMLIDAR_TOP").read(K)
    assert points.dtype.names == own.dtype.names
    for name in own.dtype.names:
        np.testing.assert_array_equal(points[name], -own[name] if name == "y" else own[name])
    assert points["object_idx"].max() == analytic_scene.LARGE_ID


def test_detections_of_a_radar_are_points_to_the_left_and_up(of_every_kind: Messages) -> None:
    """By hand, from the definition of azimuth (to the right) and altitude (up)."""
    found = columns(of_every_kind["/RADAR_LEFT/points"][K][1])
    assert len(found) == len(analytic_scene.DETECTIONS)
    for row, (rate, azimuth, altitude, depth) in zip(found, analytic_scene.DETECTIONS, strict=True):
        x = depth * np.cos(altitude) * np.cos(azimuth)
        left = -depth * np.cos(altitude) * np.sin(azimuth)
        up = depth * np.sin(altitude)
        np.testing.assert_allclose([row["x"], row["y"], row["z"]], [x, left, up], rtol=1e-5)
        assert [row["velocity"], row["azimuth"], row["elevation"], row["range"]] == pytest.approx(
            [rate, -azimuth, altitude, depth]
        )


def test_the_imu_turns_its_axes(every_kind: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(every_kind, tmp_path / "dataset"))

    def edit(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        turned = {"accelerometer": [1.0, 2.0, 9.0], "gyroscope": [0.1, 0.2, 0.3]}
        return [{**row, **turned, "compass_rad": 1.25} for row in rows]

    edit_rows(copy, "sensors/IMU.parquet", edit)
    read = exported_messages(copy, tmp_path / "out")["/IMU/imu"][K][1]
    np.testing.assert_array_equal(vector(read.linear_acceleration), [1.0, -2.0, 9.0])
    np.testing.assert_array_equal(vector(read.angular_velocity), [-0.1, 0.2, -0.3])
    assert (read.compass_rad, read.frame_id) == (1.25, "IMU")


def test_readings_of_other_packages_are_numbers_with_names(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kind that only its row in the table tells of, in place of the IMU."""
    drift = replace(sensor_kind("imu"), name="drift", blueprint="sensor.other.drift")
    monkeypatch.setattr(table, "_kinds", {**table._kinds, "drift": drift})
    copy = Path(shutil.copytree(dataset, tmp_path / "dataset"))
    path = attempt_of(copy) / "calibration.json"
    path.write_text(path.read_text().replace('"kind": "imu"', '"kind": "drift"'))
    recommit(copy)
    read = exported_messages(copy, tmp_path / "out")
    assert "/IMU/imu" not in read
    readings = read["/IMU/readings"][K][1]
    own = Dataset(dataset).episodes[0].sensor("IMU").read(K)
    assert list(readings.names) == [
        *(f"accelerometer[{axis}]" for axis in range(3)),
        *(f"gyroscope[{axis}]" for axis in range(3)),
        "compass_rad",
    ]
    assert list(readings.values) == own.tolist()
    export_dataset("mcap", copy, tmp_path / "ros", ExportOptions(messages="ros2"), workers=0)
    (path,) = (tmp_path / "ros").glob("*.mcap")
    pairs = ros2_messages(path)["/IMU/readings"][K][1].status[0].values
    assert [float(pair.value) for pair in pairs] == own.tolist()


def test_the_ego_s_signals_are_those_of_its_table(
    of_every_kind: Messages, episode: Episode
) -> None:
    rows = episode.ego().to_pylist()
    for k, row in enumerate(rows):
        odometry, fix, state = (
            of_every_kind[f"/ego/{what}"][k][1] for what in ("odometry", "fix", "state")
        )
        np.testing.assert_allclose(vector(odometry.linear_velocity), row["velocity_ego"] * MIRROR)
        np.testing.assert_allclose(
            vector(odometry.angular_velocity), row["angular_velocity_ego"] * -MIRROR, atol=1e-12
        )
        on_map = pose(odometry.pose.position, odometry.pose.orientation)
        own = pose_matrix(row["location"], row["rotation_deg"])
        flip = np.diag([1.0, -1.0, 1.0, 1.0])
        np.testing.assert_allclose(on_map, flip @ own @ flip, atol=1e-9)
        assert (odometry.frame_id, odometry.body_frame_id) == ("map", "ego")
        assert (fix.latitude, fix.longitude, fix.altitude) == (
            row["latitude_deg"], row["longitude_deg"], row["altitude_m"],
        )  # fmt: skip
        assert state.HasField("acceleration") == (row["acceleration_ego"] is not None)
        if state.HasField("acceleration"):
            np.testing.assert_allclose(vector(state.acceleration), row["acceleration_ego"] * MIRROR)
        assert (state.speed_m_s, state.yaw_rate_rad_s) == (row["speed"], row["yaw_rate_flu"])
        for name in ("throttle", "steer", "brake", "hand_brake", "reverse", "gear", "weather",
                     "speed_limit_kmh", "traffic_light_state", "weather_preset"):  # fmt: skip
            assert getattr(state, name) == row[name], name
    assert rows[K]["speed"] > 1.0


@pytest.mark.parametrize("gnss_north", ["+y", "-y"])
def test_fixes_agree_with_the_ego_s_table_whatever_the_server_reads(
    dataset: Path, tmp_path: Path, gnss_north: str
) -> None:
    """The antenna stands two metres above the ego's pivot."""
    copy = Path(shutil.copytree(dataset, tmp_path / "dataset"))
    reference = {"latitude_deg": 49.0, "longitude_deg": 8.0, "altitude_m": 100.0,
                 "projection": "transverse_mercator", "gnss_north": gnss_north}  # fmt: skip
    path = attempt_of(copy) / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"geo_reference": reference}))
    globe = GeoFrame.from_json(reference)
    antenna = {k: pose[:3, 3] for k, pose in
               Dataset(dataset).episodes[0].world_from_sensor()["GNSS"].items()}  # fmt: skip

    def read(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{**row, **degrees(globe.gnss_place(antenna[row["k"]]))} for row in rows]

    def place(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{**row, **degrees(globe.place(row["location"]))} for row in rows]

    edit_rows(copy, "sensors/GNSS.parquet", read)
    edit_rows(copy, "ego.parquet", place)
    recommit(copy)
    fixes = exported_messages(copy, tmp_path / "out")["/GNSS/fix"]
    rows = Dataset(copy).episodes[0].ego().to_pylist()
    assert len({row["latitude_deg"] for row in rows}) > 1
    for row, (_, fix) in zip(rows, fixes, strict=True):
        assert fix.latitude == pytest.approx(row["latitude_deg"], abs=1e-10)
        assert fix.longitude == pytest.approx(row["longitude_deg"], abs=1e-10)
        assert fix.altitude == pytest.approx(row["altitude_m"] + 2.0)


def degrees(place: Any) -> dict[str, float]:
    return {name: getattr(place, name) for name in ("latitude_deg", "longitude_deg", "altitude_m")}


def test_every_frame_is_there_at_its_time(messages: Messages) -> None:
    labelled, truth = ("image", "calibration", "annotations"), ("image", "calibration")
    topics = {
        "": ("tf", "objects"), "/ego": ("odometry", "fix", "state"),
        "/CAM_FRONT": labelled, "/CAM_LEFT": labelled, "/DEPTH_FRONT": truth,
        "/SEM_FRONT": (*truth, "colors"), "/INST_FRONT": (*truth, "tags", "colors"),
        "/LIDAR_TOP": ("points",), "/IMU": ("imu",), "/GNSS": ("fix",),
    }  # fmt: skip
    assert set(messages) == {f"{first}/{what}" for first, all_ in topics.items() for what in all_}
    for entries in messages.values():
        assert [time for time, _ in entries] == [k * 100_000_000 for k in range(6)]


def test_pictures_and_points_are_the_dataset_s(messages: Messages, dataset) -> None:
    episode = Dataset(dataset).episodes[0]
    image = messages["/CAM_LEFT/image"][3][1]
    assert (image.format, image.frame_id) == ("png", "CAM_LEFT")
    with Image.open(io.BytesIO(image.data)) as picture:
        np.testing.assert_array_equal(np.asarray(picture), episode.sensor("CAM_LEFT").read(3))
    cloud = messages["/LIDAR_TOP/points"][3][1]
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity"]
    points = np.frombuffer(cloud.data, "<f4").reshape(-1, cloud.point_stride // 4)
    own = episode.sensor("LIDAR_TOP").read(3)
    np.testing.assert_array_equal(points, own * np.array([1, -1, 1, 1], np.float32))


def test_cubes_project_onto_the_annotations_of_the_picture(messages: Messages, dataset) -> None:
    """Through /tf, /objects and the calibration alone, as a viewer does it."""
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    compared = 0
    for k in range(6):
        poses = {t.child_frame_id: (t.parent_frame_id, pose(t.translation, t.rotation))
                 for t in messages["/tf"][k][1].transforms}  # fmt: skip
        assert poses["ego"][0] == "map"
        assert poses["CAM_FRONT"][0] == "ego"
        camera_from_map = np.linalg.inv(poses["ego"][1] @ poses["CAM_FRONT"][1])
        projection = np.reshape(messages["/CAM_FRONT/calibration"][k][1].P, (3, 4))
        for entity in messages["/objects"][k][1].entities:
            (cube,) = entity.cubes
            half = np.array([cube.size.x, cube.size.y, cube.size.z]) / 2
            signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
            local = np.column_stack([signs * half, np.ones(8)])
            map_from_box = pose(cube.pose.position, cube.pose.orientation)
            uvw = local @ map_from_box.T @ camera_from_map.T @ projection.T
            seen = [r for r in rows if r["k"] == k and r["sensor_id"] == "CAM_FRONT"
                    and str(r["track_id"]) == entity.id and not r["n_behind"]]  # fmt: skip
            for row in seen:
                uv = uvw[:, :2] / uvw[:, 2:]
                np.testing.assert_allclose(
                    [*uv.min(axis=0), *uv.max(axis=0)], row["bbox_amodal_unclipped"], atol=0.05
                )
                compared += 1
    assert compared >= 12


def test_annotations_are_the_2d_boxes(messages: Messages, dataset) -> None:
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    drawn = messages["/CAM_FRONT/annotations"][0][1]
    seen = [r for r in rows if r["k"] == 0 and r["sensor_id"] == "CAM_FRONT" and r["visible"]]
    assert len(drawn.points) == len(drawn.texts) == len(seen) > 0
    for row, loop in zip(sorted(seen, key=lambda r: r["track_id"]), drawn.points, strict=True):
        xs, ys = [p.x for p in loop.points], [p.y for p in loop.points]
        assert [min(xs), min(ys), max(xs), max(ys)] == pytest.approx(row["bbox_amodal"])


def test_a_class_map_names_what_it_keeps_in_3d_and_2d(dataset: Path, tmp_path: Path) -> None:
    mapped = ClassMap.of({"car": "vehicle", "walker_adult": "person"})
    read = exported_messages(dataset, tmp_path / "out", class_map=mapped)
    rows = [r for r in Dataset(dataset).episodes[0].objects().to_pylist() if r["k"] == 0]
    wanted = {
        str(row["track_id"]): mapped.target(row["class"], row["blueprint"]).name
        for row in rows
        if row["class"] in ("car", "walker_adult") and not row["is_ego"]
    }
    assert set(wanted.values()) == {"vehicle", "person"}
    assert len(wanted) < len(rows) - 1
    boxes = {e.id: e.metadata for e in read["/objects"][0][1].entities}
    assert {track: facts[0].value for track, facts in boxes.items()} == wanted
    assert {facts[0].key for facts in boxes.values()} == {"name"}
    texts = {text.text for text in read["/CAM_FRONT/annotations"][0][1].texts}
    assert texts
    assert texts <= {f"{name} {track}" for track, name in wanted.items()}


def test_the_options_choose_among_the_3d_boxes(dataset: Path, tmp_path: Path) -> None:
    rows = [r for r in Dataset(dataset).episodes[0].objects().to_pylist() if r["k"] == 0]
    cars = [r for r in rows if r["class"] == "car" and not r["is_ego"]]
    near = sorted(r["distance_ego"] for r in cars)[0] + 0.1
    read = exported_messages(dataset, tmp_path / "out", classes=("car",), max_distance_m=near)
    (entity,) = read["/objects"][0][1].entities
    (car,) = [r for r in cars if r["distance_ego"] <= near]
    assert len(cars) > 1
    assert entity.id == str(car["track_id"])
