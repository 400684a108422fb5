"""What an actor is: its Car-STAGE class from the blueprint's attributes."""

from __future__ import annotations

from typing import Final

from carstage.rawlog.reader import ActorInfo

VEHICLE_CLASSES: Final = ("car", "van", "truck", "bus", "motorcycle", "bicycle")
WALKER_CLASSES: Final = ("walker_adult", "walker_child", "walker_wheelchair")
TWO_WHEELERS: Final = frozenset({"motorcycle", "bicycle"})

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
