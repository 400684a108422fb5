"""From a YAML file and ``--set`` overrides to a checked configuration."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from carstage.config.explain import config_error
from carstage.config.fields import path_text, shortened, unknown
from carstage.config.model import Config
from carstage.config.plain_values import DEEPEST, plain_copy
from carstage.config.yaml_text import parse_yaml
from carstage.errors import ConfigError
from carstage.files.bounded import read_bounded

#: Sections that may be written as their `choice` alone.
_SHORT_FORMS = frozenset({"map", "weather"})
_MOST_BYTES = 2_000_000
_STEP = re.compile(r"\.?([A-Za-z_][A-Za-z0-9_-]*)|\[([^\]]+)\]|\.([0-9]+)")
_INDEX = re.compile("[0-9]{1,9}")


def load_config(path: Path | str, overrides: Iterable[str] = ()) -> Config:
    """Read, override and check a configuration file.

    Args:
        path: the YAML file.
        overrides: ``key=value`` with a dotted key and a YAML value, such as ``fps=20`` or
            ``rig.sensors[CAM_FRONT].attributes.fov_deg=60``.

    Raises:
        ConfigError: the file cannot be read or something in it is wrong.
    """
    path = Path(path)
    try:
        text = read_bounded(path, _MOST_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        if isinstance(error, OSError):
            reason = error.strerror
        elif isinstance(error, UnicodeDecodeError):
            reason = "it is not UTF-8 text"
        else:
            reason = f"there is no such name ({error})"
        raise ConfigError(
            f"The configuration {path} cannot be read: {reason}.",
            "Name a file of YAML text; `carstage config init FILE` writes one.",
        ) from error
    return parse_config(text, overrides, source=str(path))


def load_demo(overrides: Iterable[str] = ()) -> Config:
    """The demonstration's configuration, overridden and checked."""
    text = resources.files("carstage.config").joinpath("demo.yaml").read_text("utf-8")
    return parse_config(text, overrides, source="the demo configuration")


def parse_config(text: str, overrides: Iterable[str] = (), *, source: str = "config") -> Config:
    """Check a configuration given as YAML text; see ``load_config``."""
    document = parse_yaml(text, source)
    if document is None:
        document = {}
    if not isinstance(document, dict):
        raise ConfigError(
            f"{source}: the document is not a mapping of keys to values.",
            "See `carstage config init`.",
        )
    for override in overrides:
        _override(document, override)
    return check_config(document)


def check_config(document: dict[str, Any]) -> Config:
    """The configuration that a document of plain values stands for.

    Args:
        document: mappings with words as keys, lists, words, numbers, booleans, None; not changed.

    Raises:
        ConfigError: something in it is wrong; the message names every field at fault.
    """
    document = plain_copy(document)
    if not isinstance(document, dict):
        raise ConfigError(
            "The document is not a mapping of keys to values.", "See `carstage config init`."
        )
    try:
        return Config.model_validate_json(json.dumps(document))
    except ValidationError as error:
        raise config_error(error, document) from error


def dump_config(config: Config) -> dict[str, Any]:
    """A configuration as plain values, such that ``check_config`` gives it back."""
    return config.model_dump(mode="json")


def _override(document: dict[str, Any], override: str) -> None:
    key, separator, text = override.partition("=")
    steps = _steps(key.strip())
    if not separator or steps is None:
        raise ConfigError(
            f"--set {shortened(override)}: this is not key=value.",
            "Write, for example, --set fps=20 or --set rig.sensors[0].attributes.fov_deg=60.",
        )
    value = parse_yaml(text, f"--set {shortened(key)}")
    here: Any = document
    for position, step in enumerate(steps):
        last = position == len(steps) - 1
        if isinstance(here, list):
            step = _index(here, step, override)
            if last:
                here[step] = value
            here = here[step]
        elif isinstance(here, dict):
            name = str(step)
            if last:
                here[name] = value
            elif not isinstance(here.get(name), dict | list):
                here[name] = _long_form(here, name, steps[position + 1])
            here = here[name]
        else:
            above = f"{path_text(steps[:position])} is {shortened(repr(here))}"
            raise ConfigError(
                f"--set {shortened(override)}: {above}, and nothing is below that.",
                f"Set {path_text(steps[:position])} instead.",
            )


def _long_form(document: dict[str, Any], name: str, key: str | int) -> dict[str, Any]:
    """The mapping that a short form such as `weather: WetNoon` stands for, to set ``key`` in it."""
    value = document.get(name)
    if name in _SHORT_FORMS and isinstance(value, str) and key not in ("choice", "random_from"):
        return {"choice": value}
    return {}


def _steps(key: str) -> list[str | int] | None:
    steps: list[str | int] = []
    position = 0
    while position < len(key):
        match = _STEP.match(key, position)
        if match is None:
            return None
        name, bracket, number = match.groups()
        text = name or bracket or number
        steps.append(int(text) if _INDEX.fullmatch(text) else text)
        position = match.end()
    return steps if 0 < len(steps) <= DEEPEST else None


def _index(items: list[Any], step: str | int, override: str) -> int:
    if isinstance(step, int):
        if step < len(items):
            return step
        raise ConfigError(
            f"--set {shortened(override)}: there is no entry {step}.",
            f"The list has {len(items)} entries, counted from 0.",
        )
    ids = [str(item.get("id")) for item in items if isinstance(item, dict)]
    if step not in ids:
        message, hint = unknown("entry", step, ids)
        raise ConfigError(f"--set {shortened(override)}: {message}", hint)
    return next(
        position
        for position, item in enumerate(items)
        if isinstance(item, dict) and str(item.get("id")) == step
    )
