"""MCAP exports, read by the mcap package and decoded by the schemas that they carry."""

from __future__ import annotations

import io
from collections import defaultdict
from typing import Any

import numpy as np
import pytest
from PIL import Image

from carstage.dataset import Dataset
from carstage.geometry import matrix_from_quaternion

pytest.importorskip("mcap", reason="the extra mcap is not installed")

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClassesForFiles
from mcap.reader import make_reader

Messages = dict[str, list[tuple[int, Any]]]

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture(scope="module")
def messages(exported) -> Messages:
    """All messages by topic, with their log times, decoded by nothing but the file itself."""
    found: Messages = defaultdict(list)
    classes: dict[int, Any] = {}
    (path,) = exported("mcap").glob("*.mcap")
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            if schema.id not in classes:
                descriptors = FileDescriptorSet.FromString(schema.data)
                pool = DescriptorPool()
                for descriptor in descriptors.file:
                    pool.Add(descriptor)
                names = [descriptor.name for descriptor in descriptors.file]
                classes[schema.id] = GetMessageClassesForFiles(names, pool)[schema.name]
            decoded = classes[schema.id].FromString(message.data)
            found[channel.topic].append((message.log_time, decoded))
    return dict(found)


def test_every_frame_is_there_at_its_time(messages: Messages) -> None:
    labelled, truth = ("image", "calibration", "annotations"), ("image", "calibration")
    topics = {
        "": ("tf", "objects", "ego"),
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
        poses = {t.child_frame_id: (t.parent_frame_id, pose_of(t.translation, t.rotation))
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
            map_from_box = pose_of(cube.pose.position, cube.pose.orientation)
            uvw = local @ map_from_box.T @ camera_from_map.T @ projection.T
            seen = [r for r in rows if r["k"] == k and r["sensor_id"] == "CAM_FRONT"
                    and str(r["track_id"]) == entity.id and not r["n_behind"]]  # fmt: skip
            for row in seen:
                uv = uvw[:, :2] / uvw[:, 2:]
                np.testing.assert_allclose(
                    [*uv.min(axis=0), *uv.max(axis=0)], row["bbox_amodal_unclipped"], atol=0.5
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


def pose_of(translation: Any, rotation: Any) -> Any:
    pose = np.eye(4)
    pose[:3, :3] = matrix_from_quaternion([rotation.w, rotation.x, rotation.y, rotation.z])
    pose[:3, 3] = translation.x, translation.y, translation.z
    return pose
