"""Classes of vehicles, also of those whose server does not tell."""

from __future__ import annotations

from typing import Final

VEHICLE_CLASSES: Final = ("car", "van", "truck", "bus", "motorcycle", "bicycle")

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


def vehicle_class(blueprint: str, base_type: str, *, two_wheels: bool) -> str:
    """The class of a vehicle, one of ``VEHICLE_CLASSES``.

    Args:
        blueprint: its id.
        base_type: the attribute; empty where it has none.
        two_wheels: it has just two.
    """
    if base_type.lower() in VEHICLE_CLASSES:
        return base_type.lower()
    known = _BLUEPRINT_CLASS.get(blueprint)
    if known is not None:
        return known
    return "motorcycle" if two_wheels else "car"
