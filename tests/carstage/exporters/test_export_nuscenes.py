"""nuScenes exports in nuscenes-devkit: loaded, evaluated, drawn, and compared with the dataset."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PIL import Image

from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions
from carstage.exporters.formats.nuscenes_can_bus import can_messages
from carstage.exporters.formats.nuscenes_files import lidar_file, radar_file
from carstage.exporters.formats.nuscenes_frame import radar_velocity
from carstage.exporters.formats.nuscenes_scenes import key_frame_step
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
    assert np.diff(times).tolist() == [500_000]
    for instance in nusc.instance:
        token, count = instance["first_annotation_token"], 0
        while token:
            annotation = nusc.get("sample_annotation", token)
            assert annotation["instance_token"] == instance["token"]
            last, token, count = token, annotation["next"], count + 1
        assert (last, count) == (instance["last_annotation_token"], instance["nbr_annotations"])


def test_sweeps_lie_between_key_frames_and_belong_to_the_next_one(nusc, exported) -> None:
    first, last = (sample["token"] for sample in nusc.sample)
    for channel in ("CAM_FRONT", "CAM_LEFT", "LIDAR_TOP"):
        token, rows = nusc.get("sample", first)["data"][channel], []
        while token:
            rows.append(nusc.get("sample_data", token))
            assert rows[-1]["prev"] == (rows[-2]["token"] if len(rows) > 1 else "")
            token = rows[-1]["next"]
        assert np.diff([row["timestamp"] for row in rows]).tolist() == [100_000] * 5
        assert [row["is_key_frame"] for row in rows] == [True, *[False] * 4, True]
        assert [row["sample_token"] for row in rows] == [first, *[last] * 5]
        for row in rows:
            kind = "samples" if row["is_key_frame"] else "sweeps"
            assert row["filename"].startswith(f"{kind}/{channel}/")
            assert (exported("nuscenes") / row["filename"]).is_file()


def test_the_devkit_moves_boxes_on_sweeps_to_where_objects_are(nusc, dataset) -> None:
    rows = Dataset(dataset).episodes[0].objects().to_pylist()
    (map_row,) = nusc.map
    shift = np.array([*map_row["global_from_enu_m"], 0.0])
    k = 2
    key = nusc.get("sample_data", nusc.sample[0]["data"]["LIDAR_TOP"])
    sweep = nusc.get("sample_data", nusc.get("sample_data", key["next"])["next"])
    truth = [
        np.array(row["box_center"]) * [1, -1, 1] + shift
        for row in rows
        if row["k"] == k and not row["is_ego"]
    ]
    boxes = nusc.get_boxes(sweep["token"])
    assert len(boxes) == 4
    for box in boxes:
        assert min(np.linalg.norm(box.center - center) for center in truth) < 1e-4


def test_the_devkit_puts_sweeps_one_upon_another(devkit, nusc) -> None:
    points, times = devkit.LidarPointCloud.from_file_multisweep(
        nusc, nusc.sample[1], "LIDAR_TOP", "LIDAR_TOP", nsweeps=4, min_distance=0.0
    )
    np.testing.assert_allclose(np.unique(times), [0.0, 0.1, 0.2, 0.3], atol=1e-6)
    # The light does not move: it stays where it is, seen from wherever the ego was.
    near = np.linalg.norm(points.points[:2] - np.array([[-4.0], [17.3]]), axis=0) < 3.0
    assert near.any()


@pytest.mark.parametrize(("asked_hz", "samples"), [(10.0, 6), (5.0, 3)])
def test_another_rate_of_key_frames(exported, asked_hz: float, samples: int) -> None:
    folder = exported("nuscenes", keyframes_hz=asked_hz) / NUSCENES_VERSION
    assert len(json.loads((folder / "sample.json").read_text())) == samples
    flags = [row["is_key_frame"] for row in json.loads((folder / "sample_data.json").read_text())]
    assert (len(flags), sum(flags)) == (18, 3 * samples)


def test_a_rate_that_does_not_divide_is_refused(exported) -> None:
    with pytest.raises(BadInputError, match=r"keyframes-hz.*10 frames per second.*multiple of 3"):
        exported("nuscenes", keyframes_hz=3.0)


def test_without_a_common_multiple_every_frame_is_a_key_frame() -> None:
    def step(fps: float, save_every: int = 1, *, synchronous: bool = True) -> int:
        timing = SimpleNamespace(synchronous=synchronous)
        spec = SimpleNamespace(fps=fps, save_every=save_every, timing=timing)
        return key_frame_step(SimpleNamespace(id="a", spec=spec), ExportOptions())  # type: ignore[arg-type]

    assert [step(20.0), step(10.0, 5), step(12.0)] == [10, 1, 6]
    assert [step(5.0), step(1.0), step(25.0), step(10.0, synchronous=False)] == [1] * 4


def test_the_devkit_reads_what_the_car_s_instruments_say(nusc, exported, dataset) -> None:
    can_bus = pytest.importorskip("nuscenes.can_bus.can_bus_api", reason="no nuscenes-devkit")
    can = can_bus.NuScenesCanBus(dataroot=str(exported("nuscenes")))
    name = nusc.scene[0]["name"]
    poses = can.get_messages(name, "pose")
    egos = Dataset(dataset).episodes[0].ego().to_pylist()
    assert [row["utime"] for row in poses] == [row["timestamp"] for row in nusc.ego_pose]
    for message, row in zip(poses, nusc.ego_pose, strict=True):
        assert message["pos"] == row["translation"]
        assert message["orientation"] == row["rotation"]
        np.testing.assert_allclose(message["vel"], [5.0, 0.0, 0.0], atol=1e-5)
        np.testing.assert_allclose(message["accel"], [0.0, 0.0, 9.81])
    inertial = can.get_messages(name, "ms_imu")
    assert len(inertial) == len(egos) == 6
    np.testing.assert_allclose(inertial[3]["linear_accel"], [0.0, 0.0, 9.81])
    assert {row["value"] for row in can.get_messages(name, "steeranglefeedback")} == {0.0}
    monitor = can.get_messages(name, "vehicle_monitor")[2]
    assert (monitor["throttle"], monitor["brake"], monitor["brake_switch"]) == (400, 0, 1)
    assert (monitor["gear_position"], monitor["left_signal"]) == (7, 0)
    assert monitor["vehicle_speed"] == pytest.approx(18.0, abs=0.01)
    route, pose = can.get_pose_and_route(name)
    np.testing.assert_allclose(route, pose)
    meta = can.get_messages(name, "meta")
    assert sorted(meta) == ["ms_imu", "pose", "steeranglefeedback", "vehicle_monitor"]
    assert meta["pose"]["message_count"] == 6
    assert meta["pose"]["message_freq"] == pytest.approx(10.0)
    positions = np.array([row["pos"] for row in poses])
    statistics = meta["pose"]["var_stats"]
    np.testing.assert_allclose(statistics["pos"]["mean"], positions.mean(axis=0))
    np.testing.assert_allclose(statistics["pos"]["std"], positions.std(axis=0), atol=1e-9)
    np.testing.assert_allclose(
        statistics["diff_pos"]["max"], np.diff(positions, axis=0).max(axis=0), atol=1e-9
    )


def test_steering_braking_and_lights_have_nuscenes_units_and_signs() -> None:
    ego = {
        "steer": 0.5, "throttle": 0.0, "brake": 1.0, "gear": 0, "speed": 10.0,
        "yaw_rate_flu": -0.1, "acceleration": None, "rotation_deg": (0.0, 0.0, 0.0),
        "angular_velocity_ego": (0.0, 0.0, 0.1), "velocity_ego": (10.0, 0.0, 0.0),
    }  # fmt: skip
    messages = can_messages(ego, {"light_state": 0x10 | 0x1}, np.eye(4))
    assert messages["steeranglefeedback"]["value"] == pytest.approx(np.radians(35.0))
    monitor = messages["vehicle_monitor"]
    assert (monitor["brake"], monitor["brake_switch"], monitor["throttle"]) == (126, 3, 0)
    assert (monitor["right_signal"], monitor["left_signal"]) == (1, 0)
    assert (monitor["gear_position"], monitor["steering"], monitor["yaw_rate"]) == (0, 35.0, -5.7)
    np.testing.assert_allclose(messages["pose"]["rotation_rate"], [0.0, 0.0, -0.1])
    assert set(can_messages({**ego, "steer": None}, None, np.eye(4))) == {"ms_imu", "pose"}


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
    assert compared >= 8


def test_boxes_project_onto_the_2d_boxes(devkit, nusc, dataset) -> None:
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    compared = 0
    for sample in nusc.sample:
        k = round((sample["timestamp"] - nusc.sample[0]["timestamp"]) / 1e5)
        for channel in ("CAM_FRONT", "CAM_LEFT"):
            _, boxes, intrinsic = nusc.get_sample_data(sample["data"][channel])
            for box in boxes:
                uv = devkit.view_points(box.corners(), intrinsic, normalize=True)[:2]
                found = [*uv.min(axis=1) + 0.5, *uv.max(axis=1) + 0.5]  # from pixels' centres
                depth = float(box.center[2])
                (seen,) = [
                    r for r in rows
                    if r["k"] == k and r["sensor_id"] == channel
                    and abs(r["depth_center"] - depth) < 1e-3
                ]  # fmt: skip
                if not seen["n_behind"]:
                    np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=0.05)
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


def test_the_devkit_draws_a_sample(nusc, tmp_path: Path, monkeypatch) -> None:
    from nuscenes.utils.map_mask import MapMask

    def to_pixel_coords(mask: Any, x: Any, y: Any) -> tuple[Any, Any]:
        px, py = original(mask, x, y)
        # numpy 2.4 makes no integer of an array with one element, as the devkit wants.
        return (px[0], py[0]) if px.size == 1 else (px, py)

    original = MapMask.to_pixel_coords
    monkeypatch.setattr(MapMask, "to_pixel_coords", to_pixel_coords)
    path = tmp_path / "sample.png"
    nusc.render_sample(nusc.sample[1]["token"], nsweeps=3, out_path=str(path), verbose=False)
    with Image.open(path) as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 20
    import matplotlib.pyplot as plt

    plt.close("all")


def test_splits_name_the_scenes(exported) -> None:
    splits = json.loads((exported("nuscenes") / NUSCENES_VERSION / "splits.json").read_text())
    assert splits == {"carstage_train": ["scene-2001"]}


def test_rings_follow_from_elevation() -> None:
    attributes = {"upper_fov": "10.0", "lower_fov": "-30.0", "channels": "5"}
    elevation = np.radians([10.0, 0.0, -10.0, -20.0, -30.0])
    points = np.column_stack(
        [np.cos(elevation), np.zeros(5), np.sin(elevation), np.full(5, 0.5)]
    ).astype(np.float32)
    rows = np.frombuffer(lidar_file(points, attributes), np.float32).reshape(-1, 5)
    assert rows[:, 4].tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(rows[:, 1], points[:, 0])  # forward is y


def test_a_radar_moves_with_the_turning_of_its_car() -> None:
    row = {"velocity": [10.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.5],
           "actor_location": [5.0, 5.0, 0.0]}  # fmt: skip
    pose = np.eye(4)
    pose[:3, 3] = (7.0, 5.0, 1.0)  # 2 m ahead of the pivot
    frame = SimpleNamespace(objects={9: row}, world_from_sensor=lambda _: pose)
    scene = SimpleNamespace(car=SimpleNamespace(track_id=9))
    radar = SimpleNamespace(id="RADAR")
    found = radar_velocity(*(cast("Any", one) for one in (scene, frame, radar)))
    assert found.tolist() == pytest.approx([10.0, -1.0, 0.0])  # clockwise: to the right


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
