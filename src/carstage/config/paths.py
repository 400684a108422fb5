"""Places in a document: ``rig.sensors[CAM_FRONT].attributes.fov_deg`` and what is there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from carstage.config.fields import path_text, shortened, unknown
from carstage.config.plain_values import DEEPEST
from carstage.config.presets import RIG_PRESETS
from carstage.config.rig import default_rig
from carstage.errors import ConfigError

#: Sections that may be written as their `choice` alone.
_SHORT_FORMS = frozenset({"map", "weather"})
_STEP = re.compile(r"\.?([A-Za-z_][A-Za-z0-9_-]*)|\[([^\]]+)\]|\.([0-9]+)")
_INDEX = re.compile("[0-9]{1,9}")


def steps_of(text: str) -> list[str | int] | None:
    """The keys and positions that a path's text names; None where it is none."""
    steps: list[str | int] = []
    position = 0
    while position < len(text):
        match = _STEP.match(text, position)
        if match is None:
            return None
        name, bracket, number = match.groups()
        part = name or bracket or number
        steps.append(int(part) if _INDEX.fullmatch(part) else part)
        position = match.end()
    return steps if 0 < len(steps) <= DEEPEST else None


def place_value(
    document: dict[str, Any], path: Sequence[str | int], value: Any, source: str = ""
) -> None:
    """Put a value at a path; mappings that are missing on the way are made.

    Args:
        document: plain values; it is changed.
        path: keys, positions, and ids of list entries.
        value: a plain value.
        source: what messages begin with.

    Raises:
        ConfigError: there is no such place.
    """
    source = source or path_text(path)
    _list_sensors(document, path)
    here: Any = document
    for position, step in enumerate(path):
        last = position == len(path) - 1
        if isinstance(here, list):
            step = _index(here, step, source)
            if last:
                here[step] = value
            here = here[step]
        elif isinstance(here, dict):
            name = str(step)
            if last:
                here[name] = value
            elif isinstance(path[position + 1], int) and not isinstance(here.get(name), list):
                raise ConfigError(
                    f"{source}: {path_text(path[: position + 1])} is no list here.",
                    f"Set {path_text(path[: position + 1])} as a whole.",
                )
            elif not isinstance(here.get(name), dict | list):
                here[name] = _long_form(here, name, path[position + 1])
            here = here[name]
        else:
            above = f"{path_text(path[:position])} is {shortened(repr(here))}"
            raise ConfigError(
                f"{source}: {above}, and nothing is below that.",
                f"Set {path_text(path[:position])} instead.",
            )


def _list_sensors(document: dict[str, Any], path: Sequence[str | int]) -> None:
    """Write out the sensors of the rig's preset, or of no rig, when the path is below one."""
    if [*path[:2]] != ["rig", "sensors"] or len(path) < 3:
        return
    if (rig := document.get("rig")) is None:
        document["rig"] = default_rig().model_dump(mode="json", exclude_unset=True)
    elif isinstance(rig, dict) and (preset := RIG_PRESETS.get(str(rig.get("preset")))):
        listed = rig.get("sensors") or []
        ids = [one.get("id") for one in listed if isinstance(one, dict)]
        if not listed or (isinstance(path[2], str) and path[2] not in ids):
            del rig["preset"]
            rig["sensors"] = [*preset.make(), *listed]


def _long_form(document: dict[str, Any], name: str, key: str | int) -> dict[str, Any]:
    """The mapping that a short form such as `weather: WetNoon` stands for, to set ``key`` in it."""
    value = document.get(name)
    if name in _SHORT_FORMS and isinstance(value, str) and key not in ("choice", "random_from"):
        return {"choice": value}
    return {}


def _index(items: list[Any], step: str | int, source: str) -> int:
    if isinstance(step, int):
        if step < len(items):
            return step
        raise ConfigError(
            f"{source}: there is no entry {step}.",
            f"The list has {len(items)} entries, counted from 0.",
        )
    ids = [str(item.get("id")) for item in items if isinstance(item, dict)]
    if step not in ids:
        message, hint = unknown("entry", step, ids)
        raise ConfigError(f"{source}: {message}", hint)
    return next(
        position
        for position, item in enumerate(items)
        if isinstance(item, dict) and str(item.get("id")) == step
    )
