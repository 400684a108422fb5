"""nuScenes-lidarseg and Panoptic nuScenes: categories of points, and instances of things."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.npz import pack_npz
from carstage.dataset import Episode
from carstage.dataset.saved_frames import Row
from carstage.exporters.class_map import ClassMap
from carstage.exporters.clouds import LabelledCloud
from carstage.exporters.formats.nuscenes_categories import CATEGORIES, category_of
from carstage.tags import TAGS_0_9_14

_CATEGORY_OF_TAG: Final = {
    "Unlabeled": "noise",
    "Roads": "flat.driveable_surface",
    "SideWalks": "flat.sidewalk",
    "Building": "static.manmade",
    "Wall": "static.manmade",
    "Fence": "static.manmade",
    "Pole": "static.manmade",
    "TrafficLight": "static.manmade",
    "TrafficSign": "static.manmade",
    "Vegetation": "static.vegetation",
    "Terrain": "flat.terrain",
    "Sky": "noise",
    "Pedestrian": "human.pedestrian.adult",
    "Rider": "noise",  # of a two-wheeler, which its actor tells
    "Car": "vehicle.car",
    "Truck": "vehicle.truck",
    "Bus": "vehicle.bus.rigid",
    "Train": "static.other",
    "Motorcycle": "vehicle.motorcycle",
    "Bicycle": "vehicle.bicycle",
    "Static": "static.manmade",
    "Dynamic": "movable_object.pushable_pullable",
    "Other": "static.other",
    "Water": "flat.other",
    "RoadLine": "flat.driveable_surface",
    "Ground": "flat.other",
    "Bridge": "static.manmade",
    "RailTrack": "flat.other",
    "GuardRail": "static.manmade",
}
_INDEX: Final = {name: index for index, name in enumerate(CATEGORIES)}
_OF_TAG: Final = np.zeros(256, np.uint8)
for _value, _tag in TAGS_0_9_14.items():
    _OF_TAG[_value] = _INDEX[_CATEGORY_OF_TAG[_tag.name]]
_EGO: Final = _INDEX["vehicle.ego"]
_FIRST_STUFF: Final = _INDEX["flat.driveable_surface"]
_MOST_INSTANCES: Final = 999
_PER_CATEGORY: Final = 1000


def point_categories(
    cloud: LabelledCloud,
    tracks: NDArray[np.int64],
    objects: Mapping[int, Row],
    own_id: int,
    class_map: ClassMap | None,
) -> NDArray[np.uint8]:
    """nuScenes-lidarseg's label ``(N,)`` of each point: its object's category, else its tag's.

    Args:
        cloud: the points.
        tracks: ``(N,)`` see ``point_objects``.
        objects: rows of ``objects.parquet`` by track id.
        own_id: of the vehicle under the LiDAR: ``vehicle.ego``.
        class_map: the options'.
    """
    labels = _OF_TAG[cloud.tags]
    for track in np.unique(tracks).tolist():
        if track == own_id:
            labels[tracks == track] = _EGO
        elif track in objects:
            category = category_of(objects[track], class_map)
            if category is not None:
                labels[tracks == track] = _INDEX[category]
    return labels


def panoptic_file(
    categories: NDArray[np.uint8], tracks: NDArray[np.int64], numbers: Mapping[int, int]
) -> bytes:
    """The NPZ of a sweep: ``data``, uint16 1000 x category + instance; 0 for stuff.

    Args:
        categories: ``(N,)`` labels of the points.
        tracks: ``(N,)`` track ids.
        numbers: the instances of a scene, see ``instance_numbers``.
    """
    instances = np.zeros(len(tracks), np.uint16)
    for track in np.unique(tracks).tolist():
        instances[tracks == track] = numbers.get(track, 0)
    instances[categories >= _FIRST_STUFF] = 0  # `vehicle.ego` is no thing either
    return pack_npz({"data": (categories.astype(np.uint16) * _PER_CATEGORY + instances)})


def instance_numbers(episode: Episode, class_map: ClassMap | None) -> dict[int, int]:
    """Number of each road user among those of its category, from 1 on, in the order of track ids.

    nuScenes has room for 999; those after them have none.
    """
    columns = ["track_id", "class", "special_type", "blueprint"]
    table = episode.objects().select(columns).group_by(columns, use_threads=False).aggregate([])
    rows: list[dict[str, Any]] = sorted(table.to_pylist(), key=lambda row: int(row["track_id"]))
    counts: Counter[str] = Counter()
    numbers: dict[int, int] = {}
    for row in rows:
        category = category_of(row, class_map)
        if category is not None and counts[category] < _MOST_INSTANCES:
            counts[category] += 1
            numbers[int(row["track_id"])] = counts[category]
    return numbers
