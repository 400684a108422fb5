"""What this simulator offers, as one JSON document: maps, blueprints, protocols, limits."""

from __future__ import annotations

from typing import Any

from carstage_sim.maps import MapCatalogue, available_towns, spawn_point_count
from carstage_sim.sensors.cameras import LARGEST_SIDE_PX, MOST_PIXELS
from carstage_sim.sensors.lidar import FASTEST_HZ, MOST_CHANNELS, MOST_POINTS_PER_S
from carstage_sim.wire.dialect import DIALECTS, dialect
from carstage_sim.world.blueprints import Attribute, Blueprint, catalogue

LIMITS: dict[str, float] = {
    "image_size_x": LARGEST_SIDE_PX,
    "image_size_y": LARGEST_SIDE_PX,
    "pixels": MOST_PIXELS,
    "channels": MOST_CHANNELS,
    "points_per_second": MOST_POINTS_PER_S,
    "rotation_frequency": FASTEST_HZ,
}
"""The largest values of sensors' attributes, and of a picture's pixels."""


def describe(protocol: str, maps: MapCatalogue | None = None) -> dict[str, Any]:
    """The document that ``--describe`` prints.

    Args:
        protocol: version of the client.
        maps: what is offered; by default the built-in towns. Of the user's own maps the number of
            spawn points is null.

    Raises:
        UnknownProtocolError: no table for that version is built in.
    """
    spoken = dialect(protocol)
    return {
        "protocol": protocol,
        "protocols": list(DIALECTS),
        "limits": LIMITS,
        "maps": [
            {"name": name, "spawn_points": _spawn_points(name)}
            for name in (maps or MapCatalogue()).names
        ],
        "blueprints": [
            _blueprint(blueprint)
            for blueprint in catalogue().values()
            if spoken.offers(blueprint.id)
        ],
    }


def _spawn_points(name: str) -> int | None:
    return spawn_point_count(name) if name in available_towns() else None


def _blueprint(blueprint: Blueprint) -> dict[str, Any]:
    return {
        "id": blueprint.id,
        "tags": blueprint.tags.split(","),
        "protocols": [name for name, spoken in DIALECTS.items() if spoken.offers(blueprint.id)],
        "attributes": [_attribute(attribute) for attribute in blueprint.attributes],
    }


def _attribute(attribute: Attribute) -> dict[str, Any]:
    return {
        "id": attribute.id,
        "type": attribute.type.name.lower(),
        "default": attribute.value,
        "recommended": list(attribute.recommended),
        "modifiable": attribute.modifiable,
        "restricted": attribute.restrict,
    }
