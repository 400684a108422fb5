"""What stands in the level without being an actor: parked vehicles, signs, parts of lights.

Read once in an episode, before its first tick. The boxes are in world coordinates, unlike those of
actors (CARLA's documentation of ``EnvironmentObject``).
"""

from __future__ import annotations

from typing import Any, Dict, List, Sequence, Tuple

import carla

from carstage.collector.internals.dialect import city_object_labels

LIGHT_HEADS = "traffic_lights"
SAME_HEAD_M = 1.0
"""Level box and actor are the same head when their centres are that near."""


def level_objects(world: Any, wanted: Sequence[str]) -> List[Dict[str, Any]]:
    """The level objects of some kinds, as rows of a world table, by label and id.

    Args:
        world: ``carla.World``.
        wanted: names of ``labels.level_objects``.
    """
    rows = []
    for name in sorted(wanted):
        heads = _light_heads(world) if name == LIGHT_HEADS else []
        for label in city_object_labels(name):
            for found in world.get_environment_objects(label):
                rows.append(_row(found, _nearest_light(found.bounding_box.location, heads)))
    rows.sort(key=lambda row: (row["label"], row["id"], row["name"], row["box"]["location"]))
    return rows


def _light_heads(world: Any) -> List[Tuple[Any, int]]:
    """Middle of each head of each traffic light actor, and the actor's id."""
    lights = sorted(world.get_actors().filter("traffic.traffic_light"), key=lambda one: int(one.id))
    return [(box.location, int(light.id)) for light in lights for box in light.get_light_boxes()]


def _nearest_light(middle: Any, heads: Sequence[Tuple[Any, int]]) -> int:
    """The light whose head is there; 0 for none."""
    near = [(head.distance(middle), actor_id) for head, actor_id in heads]
    distance_m, actor_id = min(near, default=(SAME_HEAD_M, 0))
    return actor_id if distance_m < SAME_HEAD_M else 0


def _row(found: Any, light_id: int) -> Dict[str, Any]:
    box: carla.BoundingBox = found.bounding_box
    at, extent, rotation = box.location, box.extent, box.rotation
    return {
        "id": int(found.id),
        "name": str(found.name),
        "label": int(found.type),
        "light": light_id,
        "box": {
            "location": [at.x, at.y, at.z],
            "extent": [extent.x, extent.y, extent.z],
            "rotation_deg": [rotation.pitch, rotation.yaw, rotation.roll],
        },
    }
