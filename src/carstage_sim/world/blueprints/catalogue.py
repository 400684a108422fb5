"""Puts the families of blueprints together and numbers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType

from carstage_sim.world.blueprints.model import Blueprint
from carstage_sim.world.blueprints.props import prop_blueprints
from carstage_sim.world.blueprints.sensors import sensor_blueprints
from carstage_sim.world.blueprints.triggers import trigger_blueprints
from carstage_sim.world.blueprints.vehicles import vehicle_blueprints
from carstage_sim.world.blueprints.walkers import walker_blueprints


@lru_cache(maxsize=1)
def catalogue() -> Mapping[str, Blueprint]:
    """Every blueprint by id, read only; uids count from 1 in the order of ids."""
    families = (
        *prop_blueprints(),
        *sensor_blueprints(),
        *trigger_blueprints(),
        *vehicle_blueprints(),
        *walker_blueprints(),
    )
    ordered = sorted(families, key=lambda blueprint: blueprint.id)
    return MappingProxyType({b.id: replace(b, uid=uid) for uid, b in enumerate(ordered, start=1)})
