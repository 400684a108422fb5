"""What an actor is: its Car-STAGE class from the blueprint's attributes."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from carstage.rawlog.reader import ActorInfo
from carstage.spec.vehicle_classes import vehicle_class

WALKER_CLASSES: Final = ("walker_adult", "walker_child", "walker_wheelchair")
TWO_WHEELERS: Final = frozenset({"motorcycle", "bicycle"})

RIDER: Final = "rider"
RIDER_TAG: Final = 13
TRAFFIC_LIGHT: Final = "traffic_light"
LEVEL_CLASSES: Final = MappingProxyType(
    {
        3: "building",
        4: "wall",
        5: "fence",
        6: "pole",
        7: TRAFFIC_LIGHT,
        8: "traffic_sign",
        9: "vegetation",
        10: "terrain",
        14: "car",
        15: "truck",
        16: "bus",
        17: "train",
        18: "motorcycle",
        19: "bicycle",
        20: "static",
        21: "dynamic",
        22: "other",
        23: "water",
        26: "bridge",
        27: "rail_track",
        28: "guard_rail",
    }
)
"""Class of a level object by its semantic tag in the numbering of datasets."""


def object_class(actor: ActorInfo) -> str | None:
    """Class of a vehicle or walker; None for actors that get no label (sensors, lights)."""
    if actor.type_id.startswith("vehicle."):
        base_type = actor.attributes.get("base_type", "")
        wheels = actor.attributes.get("number_of_wheels")
        return vehicle_class(actor.type_id, base_type, two_wheels=wheels == "2")
    if actor.type_id.startswith("walker."):
        return _walker_class(actor)
    return None


def _walker_class(actor: ActorInfo) -> str:
    if actor.attributes.get("use_wheelchair", "").lower() == "true":
        return "walker_wheelchair"
    return "walker_child" if actor.attributes.get("age", "").lower() == "child" else "walker_adult"
