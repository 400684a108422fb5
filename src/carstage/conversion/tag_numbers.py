"""Datasets number semantic tags as CARLA does since 0.9.14; older servers' data are renumbered."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.point_sensors import record_dtype
from carstage.sensor_kinds import content_of, sensor_kind
from carstage.sensor_kinds.columns import TaggedPoint
from carstage.sensor_kinds.model import INSTANCES, TAGGED_POINTS, TAGS, VOXELS
from carstage.tags import TAGS_0_9_13, new_tag, numbers_tags_anew

_RED: Final = 2


def _table() -> NDArray[np.uint8]:
    """New tag by old one; numbers that the old table lacks stay what they are."""
    table = np.arange(256, dtype=np.uint8)
    table[list(TAGS_0_9_13)] = [new_tag(old) for old in TAGS_0_9_13]
    return table


_NEW_FROM_OLD: Final = _table()


def dataset_tag_image(server_version: str, tags: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Tags of a server in the dataset's numbers; the same array where it has them."""
    return tags if numbers_tags_anew(server_version) else _NEW_FROM_OLD[tags]


def dataset_payload(kind: str, server_version: str, payload: memoryview) -> memoryview:
    """The payload of a sensor's record with the dataset's tags; the same one where it has them.

    Args:
        kind: the sensor's.
        server_version: who wrote it.
        payload: as recorded.

    Raises:
        ValueError: its size is not one of that kind.
    """
    if numbers_tags_anew(server_version):
        return payload
    content = content_of(kind)
    if content in (TAGS, INSTANCES):
        pixels = np.frombuffer(payload, np.uint8).reshape(-1, 4).copy()
        pixels[:, _RED] = dataset_tag_image(server_version, pixels[:, _RED])
        return pixels.reshape(-1).data
    if content in (TAGGED_POINTS, VOXELS):
        points = np.frombuffer(payload, record_dtype(kind)).copy()
        points["object_tag"] = _NEW_FROM_OLD[points["object_tag"].astype(np.uint8)]
        return points.view(np.uint8).data
    if sensor_kind(kind).tags_points:
        width = len(sensor_kind(kind).columns)
        rows = np.frombuffer(payload, "<f4").reshape(-1, width).copy()
        rows[:, TaggedPoint.TAG] = _NEW_FROM_OLD[rows[:, TaggedPoint.TAG].astype(np.uint8)]
        return rows.reshape(-1).view(np.uint8).data
    return payload
