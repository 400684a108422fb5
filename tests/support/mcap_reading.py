"""MCAP files as the official reader gives them, decoded by the schemas that they carry."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from carstage.geometry import FloatArray, matrix_from_quaternion

Messages = dict[str, list[tuple[int, Any]]]
"""By topic, log times (ns) and decoded messages."""


def foxglove_messages(path: Path) -> Messages:
    """All messages of a file of Foxglove's kind; nothing but the file tells what they are."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClassesForFiles
    from mcap.reader import make_reader

    found: Messages = defaultdict(list)
    classes: dict[int, Any] = {}
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


def ros2_messages(path: Path) -> Messages:
    """All messages of a file of ROS 2's kind, decoded by mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            found[channel.topic].append((message.log_time, decoded))
    return dict(found)


def pixels(message: Any) -> Any:
    """The array of a raw picture of either kind."""
    dtype = {"rgb8": "u1", "mono8": "u1", "mono16": "<u2", "32FC1": "<f4"}[message.encoding]
    rows = np.frombuffer(bytes(message.data), dtype).reshape(message.height, -1)
    assert message.step == rows.strides[0]
    shape = (message.height, message.width, 3)
    return rows.reshape(shape) if message.encoding == "rgb8" else rows


def vector(message: Any) -> FloatArray:
    """``(3,)`` of a message with x, y and z."""
    return np.array([message.x, message.y, message.z])


def pose(translation: Any, rotation: Any) -> FloatArray:
    """``(4, 4)`` of a message's place and quaternion."""
    matrix = np.eye(4)
    matrix[:3, :3] = matrix_from_quaternion([rotation.w, rotation.x, rotation.y, rotation.z])
    matrix[:3, 3] = vector(translation)
    return matrix
