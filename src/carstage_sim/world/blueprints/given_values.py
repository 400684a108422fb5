"""The attribute values of an actor: a client's where its blueprint lets them be set."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.errors import SpawnError

_LARGEST_FLOAT32 = 3.4028234e38
_CHANNELS = re.compile(r"\s*\d+(\.\d*)?\s*(,\s*\d+(\.\d*)?\s*){2}", re.ASCII)


def actor_attributes(blueprint: Blueprint, given: Mapping[str, str]) -> dict[str, str]:
    """All attributes of an actor that is about to be spawned.

    Args:
        blueprint: the actor's.
        given: values that override the blueprint's; ones that it does not have are ignored, and so
            are values of attributes that cannot be modified.

    Raises:
        SpawnError: a value is not of its attribute's type. Of flags, colours and numbers beyond
            single precision every client that decodes such an actor throws
            (``ActorAttribute.cpp``), whoever spawned it.
    """
    values = {}
    for attribute in blueprint.attributes:
        values[attribute.id] = attribute.value
        if attribute.id in given and attribute.modifiable and attribute.kept:
            values[attribute.id] = _checked(blueprint, attribute, given[attribute.id])
    return values


def _checked(blueprint: Blueprint, attribute: Attribute, text: str) -> str:
    if attribute.type in _WANTED:
        is_fine, wanted = _WANTED[attribute.type]
        if not is_fine(text):
            raise SpawnError(f"{blueprint.id}: attribute {attribute.id} is {text!r}, not {wanted}")
    return text


def _is_flag(text: str) -> bool:
    return text.lower() in ("true", "false")


def _is_number(text: str) -> bool:
    """Whether it is a number; CARLA's own texts of some end in an ``f``."""
    try:
        value = float(text.rstrip("f"))
    except ValueError:
        return False
    return math.isfinite(value) and abs(value) <= _LARGEST_FLOAT32


def _is_colour(text: str) -> bool:
    return bool(_CHANNELS.fullmatch(text)) and all(float(part) < 256.0 for part in text.split(","))


_WANTED: dict[AttributeType, tuple[Callable[[str], bool], str]] = {
    AttributeType.BOOL: (_is_flag, "true or false"),
    AttributeType.INT: (_is_number, "a finite number"),
    AttributeType.FLOAT: (_is_number, "a finite number"),
    AttributeType.COLOR: (_is_colour, "three numbers from 0 to 255, as 255,0,0"),
}
