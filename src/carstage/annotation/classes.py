"""What an actor is: its Car-STAGE class from the blueprint's attributes."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from carstage.rawlog.reader import ActorInfo

VEHICLE_CLASSES: Final = ("car", "van", "truck", "bus", "motorcycle", "bicycle")
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

# Blueprints whose servers (before 0.9.14) report no base_type; all others are cars.
_BLUEPRINT_CLASS: Final = {
    "vehicle.bh.crossbike": "bicycle",
    "vehicle.diamondback.century": "bicycle",
    "vehicle.gazelle.omafiets": "bicycle",
    "vehicle.harley-davidson.low_rider": "motorcycle",
    "vehicle.kawasaki.ninja": "motorcycle",
    "vehicle.vespa.zx125": "motorcycle",
    "vehicle.yamaha.yzf": "motorcycle",
    "vehicle.carlamotors.carlacola": "truck",
    "vehicle.carlamotors.firetruck": "truck",
    "vehicle.tesla.cybertruck": "truck",
    "vehicle.ford.ambulance": "van",
    "vehicle.mercedes.sprinter": "van",
    "vehicle.volkswagen.t2": "van",
    "vehicle.mitsubishi.fusorosa": "bus",
}


def object_class(actor: ActorInfo) -> str | None:
    """Class of a vehicle or walker; None for actors that get no label (sensors, lights)."""
    if actor.type_id.startswith("vehicle."):
        return _vehicle_class(actor)
    if actor.type_id.startswith("walker."):
        return _walker_class(actor)
    return None


def _vehicle_class(actor: ActorInfo) -> str:
    base_type = actor.attributes.get("base_type", "").lower()
    if base_type in VEHICLE_CLASSES:
        return base_type
    known = _BLUEPRINT_CLASS.get(actor.type_id)
    if known is not None:
        return known
    return "motorcycle" if actor.attributes.get("number_of_wheels") == "2" else "car"


def _walker_class(actor: ActorInfo) -> str:
    if actor.attributes.get("use_wheelchair", "").lower() == "true":
        return "walker_wheelchair"
    return "walker_child" if actor.attributes.get("age", "").lower() == "child" else "walker_adult"
