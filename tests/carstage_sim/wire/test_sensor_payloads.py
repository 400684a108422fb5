from __future__ import annotations

import struct
from typing import Any

import msgpack
import numpy as np

from carstage_sim.sensors.measurements import (
    DVS_EVENT,
    SEMANTIC_POINT,
    CollisionFrame,
    DvsFrame,
    FlowFrame,
    GnssFrame,
    ImageFrame,
    ImuFrame,
    LidarFrame,
    ObstacleFrame,
    RadarFrame,
    SemanticLidarFrame,
    SensorFrame,
)
from carstage_sim.wire.payloads import encode_frame, sensor_header
from carstage_sim.world.pose import Pose


def joined(frame: SensorFrame) -> bytes:
    return b"".join(bytes(memoryview(part)) for part in encode_frame(frame, described))


def described(actor_id: int, label: int) -> list[Any]:
    return ["actor", actor_id, label]


def test_header_is_48_bytes_in_the_order_of_the_protocol() -> None:
    header = sensor_header(13, 7, 0.35, Pose((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    assert struct.unpack("<QQd6f", header) == (13, 7, 0.35, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def test_image_is_its_size_its_field_of_view_and_its_pixels() -> None:
    pixels = np.arange(2 * 3 * 4, dtype=np.uint8).reshape(2, 3, 4)
    payload = joined(ImageFrame(90.0, pixels))
    assert struct.unpack_from("<IIf", payload) == (3, 2, 90.0)
    assert payload[12:] == pixels.tobytes()


def test_image_is_sent_without_a_copy() -> None:
    pixels = np.zeros((4, 4, 4), np.uint8)
    _, sent = encode_frame(ImageFrame(90.0, pixels), described)
    pixels[1, 2, 3] = 200
    assert bytes(memoryview(sent)) == pixels.tobytes()


def test_flow_is_an_image_of_two_floats_per_pixel() -> None:
    flow = np.arange(12, dtype=np.float32).reshape(2, 3, 2)
    payload = joined(FlowFrame(75.0, flow))
    assert struct.unpack_from("<IIf", payload) == (3, 2, 75.0)
    assert payload[12:] == flow.tobytes()


def test_dvs_events_have_13_bytes() -> None:
    events = np.array([(3, 4, 2**40, 1), (65535, 0, 5, 0)], DVS_EVENT)
    payload = joined(DvsFrame(640, 480, 75.0, events))
    assert struct.unpack_from("<IIf", payload) == (640, 480, 75.0)
    assert DVS_EVENT.itemsize == 13
    assert list(struct.iter_unpack("<HHqB", payload[12:])) == [(3, 4, 2**40, 1), (65535, 0, 5, 0)]


def test_lidar_is_angle_counts_and_points() -> None:
    points = np.arange(12, dtype=np.float32).reshape(3, 4)
    payload = joined(LidarFrame(1.5, np.array([1, 2], np.uint32), points))
    assert struct.unpack_from("<fI2I", payload) == (1.5, 2, 1, 2)
    assert payload[16:] == points.tobytes()


def test_lidar_without_points_is_still_a_message() -> None:
    frame = LidarFrame(0.0, np.zeros(2, np.uint32), np.zeros((0, 4), np.float32))
    assert len(joined(frame)) == 16


def test_semantic_lidar_points_have_24_bytes_and_whole_ids() -> None:
    # D5: read as float32, an id above 2^24 would lose its last bits.
    points = np.zeros(2, SEMANTIC_POINT)
    points["x"], points["cos_inc_angle"] = (1.5, 2.5), (0.5, 1.0)
    points["object_idx"], points["object_tag"] = (2**24 + 1, 2**32 - 1), (14, 24)
    payload = joined(SemanticLidarFrame(0.25, np.array([2], np.uint32), points))
    assert SEMANTIC_POINT.itemsize == 24
    assert struct.unpack_from("<fII", payload) == (0.25, 1, 2)
    first, second = struct.iter_unpack("<4f2I", payload[12:])
    assert first == (1.5, 0.0, 0.0, 0.5, 2**24 + 1, 14)
    assert second == (2.5, 0.0, 0.0, 1.0, 2**32 - 1, 24)


def test_radar_is_velocity_azimuth_altitude_depth() -> None:
    payload = joined(RadarFrame(np.array([[-5.0, 0.125, 0.25, 30.0]], np.float32)))
    assert struct.unpack("<4f", payload) == (-5.0, 0.125, 0.25, 30.0)


def test_a_tick_without_returns_is_still_a_message() -> None:
    empty = SemanticLidarFrame(0.0, np.zeros(3, np.uint32), np.zeros(0, SEMANTIC_POINT))
    assert len(joined(empty)) == 8 + 3 * 4
    assert joined(RadarFrame(np.zeros((0, 4), np.float32))) == b""


def test_imu_and_gnss_are_msgpack() -> None:
    imu = ImuFrame((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 0.5)
    assert msgpack.unpackb(joined(imu)) == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], 0.5]
    assert msgpack.unpackb(joined(GnssFrame(49.0, 8.4, 1.8))) == [49.0, 8.4, 1.8]


def test_events_carry_their_actors_whole() -> None:
    collision = msgpack.unpackb(joined(CollisionFrame(5, 0, 3, (1.0, -2.0, 0.0))))
    assert collision == [["actor", 5, 0], ["actor", 0, 3], [1.0, -2.0, 0.0]]
    obstacle = msgpack.unpackb(joined(ObstacleFrame(5, 9, 0, 2.5)))
    assert obstacle == [["actor", 5, 0], ["actor", 9, 0], 2.5]
