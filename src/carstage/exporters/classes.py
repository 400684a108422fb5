"""What Car-STAGE's classes are called elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

DONT_CARE: Final = "DontCare"
RIDER: Final = "rider"


@dataclass(frozen=True, slots=True)
class ForeignNames:
    """Names of a class in formats with classes of their own.

    Attributes:
        kitti: KITTI's type; ``None``: not exported to KITTI.
        nuscenes: nuScenes's category; ``None``: not exported to nuScenes.
    """

    kitti: str | None
    nuscenes: str | None


CLASSES: Final[Mapping[str, ForeignNames]] = MappingProxyType(
    {
        "car": ForeignNames("Car", "vehicle.car"),
        "van": ForeignNames("Van", "vehicle.car"),
        "truck": ForeignNames("Truck", "vehicle.truck"),
        "bus": ForeignNames("Misc", "vehicle.bus.rigid"),
        "motorcycle": ForeignNames("Misc", "vehicle.motorcycle"),
        "bicycle": ForeignNames("Cyclist", "vehicle.bicycle"),
        "walker_adult": ForeignNames("Pedestrian", "human.pedestrian.adult"),
        "walker_child": ForeignNames("Pedestrian", "human.pedestrian.child"),
        "walker_wheelchair": ForeignNames("Pedestrian", "human.pedestrian.wheelchair"),
        "traffic_light": ForeignNames(DONT_CARE, None),
        "traffic_sign": ForeignNames(DONT_CARE, None),
        # KITTI's cyclist and nuScenes's bicycle have their rider with them.
        RIDER: ForeignNames(None, None),
        **{
            name: ForeignNames(None, None)
            for name in (
                "bridge", "building", "dynamic", "fence", "guard_rail", "other", "pole",
                "rail_track", "static", "terrain", "train", "vegetation", "wall", "water",
            )
        },
    }
)  # fmt: skip
"""All classes, in the order of their numbers in COCO (from 1)."""

VEHICLES: Final = tuple(CLASSES)[:6]
DEFAULT_CLASSES: Final = tuple(CLASSES)[:11]
"""Road users, lights and signs: what formats hold that do not ask for more."""
