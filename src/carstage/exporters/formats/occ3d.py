"""Occ3D-nuScenes: the voxels of a key frame, as networks for occupancy read them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.npz import pack_npz
from carstage.dataset import Occupancy
from carstage.dataset.saved_frames import Frame
from carstage.occupancy import FREE
from carstage.tags import TAGS_0_9_14

OCC3D_CLASSES: Final = (
    "others", "barrier", "bicycle", "bus", "car", "construction_vehicle", "motorcycle",
    "pedestrian", "traffic_cone", "trailer", "truck", "driveable_surface", "other_flat",
    "sidewalk", "terrain", "manmade", "vegetation", "free",
)  # fmt: skip
_CLASS_OF_TAG: Final[dict[str, str]] = {
    "Roads": "driveable_surface", "RoadLine": "driveable_surface", "SideWalks": "sidewalk",
    "Ground": "other_flat", "RailTrack": "other_flat", "Water": "other_flat",
    "Terrain": "terrain", "Vegetation": "vegetation", "GuardRail": "barrier",
    "Building": "manmade", "Wall": "manmade", "Fence": "manmade", "Pole": "manmade",
    "TrafficLight": "manmade", "TrafficSign": "manmade", "Bridge": "manmade",
    "Pedestrian": "pedestrian", "Car": "car", "Truck": "truck", "Bus": "bus",
    "Motorcycle": "motorcycle", "Bicycle": "bicycle", "Rider": "bicycle",
}  # fmt: skip
"""Occ3D's class of each of our tags; ``others`` of what is not here."""
_MOTORCYCLE: Final = OCC3D_CLASSES.index("motorcycle")
_RIDER: Final = next(tag for tag, known in TAGS_0_9_14.items() if known.name == "Rider")


def occ3d_semantics(content: Occupancy, frame: Frame) -> NDArray[np.uint8]:
    """``(X, Y, Z)`` uint8 numbers of Occ3D's classes; a rider is of the two-wheeler's class."""
    table = np.zeros(256, np.uint8)
    for tag, known in TAGS_0_9_14.items():
        table[tag] = OCC3D_CLASSES.index(_CLASS_OF_TAG.get(known.name, "others"))
    table[FREE] = OCC3D_CLASSES.index("free")
    semantics = table[content.semantic]
    motorcycles = [t for t, row in frame.objects.items() if row["class"] == "motorcycle"]
    rides = (content.semantic == _RIDER) & np.isin(content.tracks, motorcycles)
    semantics[rides] = _MOTORCYCLE
    return semantics


def occ3d_file(content: Occupancy, frame: Frame) -> bytes:
    """A ``labels.npz``: Occ3D's three arrays, and the two that come from boxes.

    Occ3D counts voxels as datasets do: forward, left, up.
    """
    return pack_npz(
        {
            "semantics": occ3d_semantics(content, frame),
            "mask_lidar": content.visible_by_lidar.astype(np.uint8),
            "mask_camera": content.visible_by_camera.astype(np.uint8),
            "instances": content.voxels.instance,
            "flow": content.flow_m_s[..., :2].astype(np.float16),
        }
    )
