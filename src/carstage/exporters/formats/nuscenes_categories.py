"""nuScenes's categories, and which of them an object is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from carstage.errors import BadInputError
from carstage.exporters.class_map import ClassMap
from carstage.exporters.classes import CLASSES, RIDER

CATEGORIES: Final = (
    "noise",
    "animal",
    "human.pedestrian.adult",
    "human.pedestrian.child",
    "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility",
    "human.pedestrian.police_officer",
    "human.pedestrian.stroller",
    "human.pedestrian.wheelchair",
    "movable_object.barrier",
    "movable_object.debris",
    "movable_object.pushable_pullable",
    "movable_object.trafficcone",
    "static_object.bicycle_rack",
    "vehicle.bicycle",
    "vehicle.bus.bendy",
    "vehicle.bus.rigid",
    "vehicle.car",
    "vehicle.construction",
    "vehicle.emergency.ambulance",
    "vehicle.emergency.police",
    "vehicle.motorcycle",
    "vehicle.trailer",
    "vehicle.truck",
    "flat.driveable_surface",
    "flat.other",
    "flat.sidewalk",
    "flat.terrain",
    "static.manmade",
    "static.other",
    "static.vegetation",
    "vehicle.ego",
)
"""nuScenes-lidarseg's categories; a point's label is the place in this list."""

_WITH_BOXES: Final = frozenset(CATEGORIES[1 : CATEGORIES.index("flat.driveable_surface")])
_EMERGENCY: Final = ("ambulance", "police")
_MOVING_MPS, _WALKING_MPS = 0.2, 0.1


def check_categories(class_map: ClassMap | None) -> None:
    """Refuse a class map with targets that nuScenes has no boxes of.

    Raises:
        BadInputError: naming the target.
    """
    for name, target in class_map.targets if class_map is not None else ():
        if target.name not in _WITH_BOXES:
            raise BadInputError(
                f"class-map: {target.name!r} is no category of nuScenes with boxes.",
                f"It has {', '.join(sorted(_WITH_BOXES))}.",
            )
        if target.id is not None:
            raise BadInputError(
                f"class-map: {name} has an id, and nuScenes numbers its own categories.",
                "Leave out the ids.",
            )
        if name == RIDER:
            raise BadInputError(
                "class-map: a rider has no 3D box.",
                "Leave out rider: nuScenes's bicycles have their riders with them.",
            )


def category_of(row: Mapping[str, Any], class_map: ClassMap | None) -> str | None:
    """The category of a row of ``objects.parquet``; ``None``: it is left out.

    Without a class map ambulances and police cars have their own; a fire engine is a truck.
    """
    if class_map is not None:
        target = class_map.target(row["class"], row["blueprint"])
        return None if target is None else target.name
    names = CLASSES.get(row["class"])
    if names is None or names.nuscenes is None:
        return None
    if row["special_type"] == "emergency":
        for kind in _EMERGENCY:
            if kind in row["blueprint"]:
                return f"vehicle.emergency.{kind}"
    return names.nuscenes


def attribute_of(category: str, is_static: bool, speed_mps: float) -> str | None:
    """nuScenes's attribute: what an object is doing; ``None``: its category has none."""
    if category in ("vehicle.bicycle", "vehicle.motorcycle"):
        return "cycle.without_rider" if is_static else "cycle.with_rider"
    if category.startswith("human."):
        return "pedestrian.moving" if speed_mps > _WALKING_MPS else "pedestrian.standing"
    if not category.startswith("vehicle."):
        return None
    if is_static:
        return "vehicle.parked"
    return "vehicle.moving" if speed_mps > _MOVING_MPS else "vehicle.stopped"
