"""What this simulator offers, as one JSON document: maps, blueprints, protocols."""

from __future__ import annotations

from typing import Any

from carstage_sim.maps import available_towns, load_town
from carstage_sim.wire.dialect import DIALECTS, dialect
from carstage_sim.world.blueprints import Attribute, Blueprint, catalogue


def describe(protocol: str) -> dict[str, Any]:
    """The document that ``--describe`` prints.

    Raises:
        UnknownProtocolError: no table for that version is built in.
    """
    spoken = dialect(protocol)
    return {
        "protocol": protocol,
        "protocols": list(DIALECTS),
        "maps": [
            {"name": name, "spawn_points": len(load_town(name).spawn_points)}
            for name in available_towns()
        ],
        "blueprints": [
            _blueprint(blueprint)
            for blueprint in catalogue().values()
            if spoken.offers(blueprint.id)
        ],
    }


def _blueprint(blueprint: Blueprint) -> dict[str, Any]:
    return {
        "id": blueprint.id,
        "tags": blueprint.tags.split(","),
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
