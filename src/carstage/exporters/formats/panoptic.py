"""COCO's panoptic segments from an instance image: stuff by tag, things by tag and actor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.sensor_kinds.columns import Instance
from carstage.tags import TAGS_0_9_14

_THINGS = frozenset(
    {"Pedestrian", "Rider", "Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle"}
)
_THING_VALUES = np.array([value for value, tag in TAGS_0_9_14.items() if tag.name in _THINGS])
_VOID = 0


def panoptic_categories() -> list[Mapping[str, Any]]:
    """The semantic tags as categories; their numbers are the tags' values."""
    return [
        {
            "id": value,
            "name": tag.name,
            "supercategory": "thing" if tag.name in _THINGS else "stuff",
            "isthing": int(tag.name in _THINGS),
            "color": list(tag.rgb),
        }
        for value, tag in TAGS_0_9_14.items()
        if value != _VOID
    ]


def panoptic_segments(
    instance: NDArray[np.uint16],
) -> tuple[NDArray[np.uint32], tuple[Mapping[str, Any], ...]]:
    """The segment of each pixel.

    Args:
        instance: ``(H, W, 2)`` id (low 16 bits of the actor's) and semantic tag.

    Returns:
        ``(H, W)`` segment ids, the tag times 65536 plus the actor's id (0 for stuff), and 0 where
        nothing is known; and the rows of ``segments_info``.
    """
    ids, tags = (instance[..., part].astype(np.uint32) for part in (Instance.ID, Instance.TAG))
    things = np.isin(tags, _THING_VALUES).astype(np.uint32)
    segments = np.asarray(tags << 16 | ids * things, np.uint32)
    segments[tags == _VOID] = _VOID
    rows = []
    areas = np.bincount(segments.ravel())
    for value in np.flatnonzero(areas).tolist():
        if value == _VOID:
            continue
        mask = segments == value
        x, y = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        left, top = int(x[0]), int(y[0])
        rows.append(
            {
                "id": value,
                "category_id": value >> 16,
                "area": int(areas[value]),
                "bbox": [left, top, int(x[-1]) + 1 - left, int(y[-1]) + 1 - top],
                "iscrowd": 0,
            }
        )
    return segments, tuple(rows)
