"""MCAP exports with ROS 2's messages, decoded by mcap-ros2-support from the files alone."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from carstage.dataset import Dataset, Episode
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset, exporter_for
from carstage.exporters.formats import mcap_records
from carstage.geometry import pose_matrix
from mcap_reading import Messages, foxglove_messages, pixels, pose, ros2_messages, vector

pytest.importorskip("rosbags", reason="the extra ros2 is not installed")

from carstage.exporters.formats.ros2_messages import messages as made_messages

pytestmark = pytest.mark.xdist_group("export")
MIRROR = np.array([1.0, -1.0, 1.0])
FLIP = np.diag([1.0, -1.0, 1.0, 1.0])
K = 3


def export(dataset: Path, out: Path, messages: str) -> Path:
    """The file of the one episode."""
    export_dataset("mcap", dataset, out, ExportOptions(messages=messages), workers=0)
    (path,) = out.glob("*.mcap")
    return path


@pytest.fixture(scope="module")
def messages(every_kind: Path, tmp_path_factory: pytest.TempPathFactory) -> Messages:
    return ros2_messages(export(every_kind, tmp_path_factory.mktemp("export") / "out", "ros2"))


@pytest.fixture(scope="module")
def foxglove(every_kind: Path, tmp_path_factory: pytest.TempPathFactory) -> Messages:
    out = tmp_path_factory.mktemp("export") / "out"
    return foxglove_messages(export(every_kind, out, "foxglove"))


@pytest.fixture(scope="module")
def episode(every_kind: Path) -> Episode:
    return Dataset(every_kind).episodes[0]


def test_equal_datasets_give_equal_bytes(dataset: Path, tmp_path: Path) -> None:
    first, second = (export(dataset, tmp_path / name, "ros2").read_bytes() for name in "ab")
    assert first == second


def test_stamps_are_the_times_of_the_frames(messages: Messages) -> None:
    stamped = 0
    for entries in messages.values():
        assert [time for time, _ in entries] == [k * 100_000_000 for k in range(6)]
        for time, message in entries:
            if hasattr(message, "header"):
                stamp = message.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == time
                stamped += 1
    assert stamped > 100


def test_every_sensor_has_a_channel(messages: Messages, episode: Episode) -> None:
    for sensor in episode.sensors:
        assert [topic for topic in messages if topic.startswith(f"/{sensor.id}/")], sensor.id


def test_pictures_are_the_dataset_s(messages: Messages, episode: Episode) -> None:
    for camera in ("CAM_FRONT", "NORMALS_LEFT"):
        image = messages[f"/{camera}/image/compressed"][K][1]
        assert (image.format, image.header.frame_id) == ("png", camera)
        with Image.open(io.BytesIO(bytes(image.data))) as picture:
            np.testing.assert_array_equal(np.asarray(picture), episode.sensor(camera).read(K))
    own = {
        "/DEPTH_FRONT/image": episode.sensor("DEPTH_FRONT").read(K),
        "/SEM_FRONT/image": episode.sensor("SEM_FRONT").read(K),
        "/INST_FRONT/image": episode.sensor("INST_FRONT").read(K)[..., 0],
        "/INST_FRONT/tags": episode.sensor("INST_FRONT").read(K)[..., 1],
        "/FLOW_FRONT/right": episode.sensor("FLOW_FRONT").read(K)[..., 0],
        "/FLOW_FRONT/down": episode.sensor("FLOW_FRONT").read(K)[..., 1],
    }
    for topic, values in own.items():
        np.testing.assert_array_equal(pixels(messages[topic][K][1]), values, topic)
    info = messages["/CAM_LEFT/camera_info"][K][1]
    camera = episode.sensor("CAM_LEFT").calibration
    from_centre = camera.k - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    np.testing.assert_array_equal(info.k, from_centre.ravel())
    np.testing.assert_array_equal(np.reshape(info.p, (3, 4))[:, :3], from_centre)
    assert (info.width, info.height) == (camera.width, camera.height)
    # Without a model, image_geometry refuses to rectify: the distortion is unknown to it.
    assert (info.distortion_model, list(info.d)) == ("plumb_bob", [0.0] * 5)


def columns(cloud: Any) -> Any:
    kind = np.dtype([(f.name, {7: "<f4", 6: "<u4"}[f.datatype]) for f in cloud.fields])
    assert [f.offset for f in cloud.fields] == [kind.fields[f.name][1] for f in cloud.fields]
    assert (cloud.point_step, cloud.row_step) == (kind.itemsize, kind.itemsize * cloud.width)
    return np.frombuffer(bytes(cloud.data), kind)


def test_point_clouds_have_left_positive(messages: Messages, episode: Episode) -> None:
    for sensor in ("LIDAR_TOP", "SEMLIDAR_TOP"):
        points, own = columns(messages[f"/{sensor}/points"][K][1]), episode.sensor(sensor).read(K)
        names = own.dtype.names or ("x", "y", "z", "intensity")
        assert points.dtype.names == names
        for index, name in enumerate(names):
            values = own[name] if own.dtype.names else own[:, index]
            np.testing.assert_array_equal(points[name], -values if name == "y" else values)
    radar = columns(messages["/RADAR_LEFT/points"][K][1])
    np.testing.assert_array_equal(radar["velocity"], analytic_scene.DETECTIONS[:, 0])
    np.testing.assert_array_equal(radar["azimuth"], -analytic_scene.DETECTIONS[:, 1])
    np.testing.assert_allclose(
        np.hypot(np.hypot(radar["x"], radar["y"]), radar["z"]), radar["range"], rtol=1e-6
    )


def test_readings_and_the_ego_are_the_tables(messages: Messages, episode: Episode) -> None:
    row = episode.ego().to_pylist()[K]
    odometry = messages["/ego/odometry"][K][1]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "ego")
    own = FLIP @ pose_matrix(row["location"], row["rotation_deg"]) @ FLIP
    found = odometry.pose.pose
    np.testing.assert_allclose(pose(found.position, found.orientation), own, atol=1e-9)
    twist = odometry.twist.twist
    np.testing.assert_allclose(vector(twist.linear), row["velocity_ego"] * MIRROR)
    np.testing.assert_allclose(
        vector(twist.angular), row["angular_velocity_ego"] * -MIRROR, atol=1e-12
    )
    place = messages["/ego/fix"][K][1]
    assert (place.latitude, place.longitude, place.altitude) == (
        row["latitude_deg"], row["longitude_deg"], row["altitude_m"],
    )  # fmt: skip
    fix = messages["/GNSS/fix"][K][1]
    assert fix.latitude == pytest.approx(row["latitude_deg"], abs=1e-10)
    assert fix.altitude == pytest.approx(row["altitude_m"] + 2.0)
    values = {pair.key: pair.value for pair in messages["/ego/signals"][K][1].status[0].values}
    assert float(values["throttle"]) == row["throttle"] > 0.0
    assert float(values["speed_m_s"]) == row["speed"] > 0.0
    assert values["traffic_light_state"] == row["traffic_light_state"]
    reading = episode.sensor("IMU").read(K)
    imu = messages["/IMU/imu"][K][1]
    np.testing.assert_array_equal(vector(imu.linear_acceleration), reading[:3] * MIRROR)
    assert imu.orientation_covariance[0] == -1.0
    assert messages["/IMU/compass"][K][1].data == reading[6]


def test_transforms_and_labels_are_those_of_the_other_kind(
    messages: Messages, foxglove: Messages
) -> None:
    """Foxglove's are compared with the tables elsewhere."""
    for k in range(6):
        ours = {t.child_frame_id: (t.header.frame_id, pose(t.transform.translation,
                t.transform.rotation)) for t in messages["/tf"][k][1].transforms}  # fmt: skip
        for other in foxglove["/tf"][k][1].transforms:
            parent, found = ours.pop(other.child_frame_id)
            assert parent == other.parent_frame_id
            np.testing.assert_array_equal(found, pose(other.translation, other.rotation))
        assert not ours
        boxes = {d.id: d for d in messages["/objects"][k][1].detections}
        cleared, *markers = messages["/objects/markers"][k][1].markers
        assert (cleared.action, len(markers)) == (3, len(boxes))
        for entity, marker in zip(foxglove["/objects"][k][1].entities, markers, strict=True):
            box, (cube,) = boxes.pop(entity.id), entity.cubes
            own = pose(cube.pose.position, cube.pose.orientation)
            centre = box.bbox.center
            np.testing.assert_array_equal(pose(centre.position, centre.orientation), own)
            np.testing.assert_array_equal(vector(box.bbox.size), vector(cube.size))
            np.testing.assert_array_equal(vector(marker.scale), vector(cube.size))
            facts = {pair.key: pair.value for pair in entity.metadata}
            assert box.results[0].hypothesis.class_id == marker.ns == facts["name"]
            assert f"track_id: {entity.id}" in marker.text
        assert not boxes
    seen = messages["/CAM_FRONT/annotations"][0][1].detections
    drawn = foxglove["/CAM_FRONT/annotations"][0][1]
    assert len(seen) == len(drawn.points) > 0
    for detection, loop, text in zip(seen, drawn.points, drawn.texts, strict=True):
        low, high = loop.points[0], loop.points[2]
        centre = detection.bbox.center.position
        middle = ((low.x + high.x) / 2 - 0.5, (low.y + high.y) / 2 - 0.5)
        assert (centre.x, centre.y) == pytest.approx(middle)  # from pixels' centres
        assert detection.bbox.size_x == pytest.approx(high.x - low.x)
        assert f"{detection.results[0].hypothesis.class_id} {detection.id}" == text.text


@pytest.mark.parametrize(
    ("sensor", "topic"),
    [
        ("CAM_FRONT", "/CAM_FRONT/image"),
        ("LIDAR.semantic", "/LIDAR_semantic/image"),  # that of `labels.lidars` has a dot
        ("front-left.1", "/front_left_1/image"),
        ("3rd", "/_3rd/image"),
    ],
)
def test_topics_are_names_that_ros_takes(sensor: str, topic: str) -> None:
    """As ``rmw_validate_full_topic_name`` has it: else a player ends with the first message."""
    record = mcap_records.Pixels(sensor, "image", "mono8", np.zeros((1, 1), np.uint8))
    (made,) = made_messages(record, 0.0)
    assert made.topic == topic


def test_sensors_that_would_share_their_topics_are_refused(tmp_path: Path) -> None:
    sensors = [SimpleNamespace(id=name) for name in ("CAM.1", "CAM-1")]
    episode: Any = SimpleNamespace(id="0123456789abcdef", sensors=sensors)
    with pytest.raises(BadInputError, match=r"'CAM\.1' and 'CAM-1' would have the same topics"):
        exporter_for("mcap", ExportOptions(messages="ros2")).begin([episode], tmp_path)
    exporter_for("mcap", ExportOptions()).begin([episode], tmp_path)
