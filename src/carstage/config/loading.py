"""From a YAML file and ``--set`` overrides to a checked configuration."""

from __future__ import annotations

import json
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from carstage.config.explain import config_error
from carstage.config.fields import shortened
from carstage.config.model import Config
from carstage.config.paths import place_value, steps_of
from carstage.config.plain_values import plain_copy
from carstage.config.sampling import check_samples, take_samples
from carstage.config.yaml_text import parse_yaml
from carstage.errors import ConfigError
from carstage.files.bounded import read_bounded

_MOST_BYTES = 2_000_000


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
    counted = "episodes" not in document
    in_words_of_the_user = take_samples(document)
    try:
        config = Config.model_validate_json(json.dumps(document))
    except ValidationError as error:
        raise in_words_of_the_user(config_error(error, document)) from error
    return check_samples(config, in_words_of_the_user, count_episodes=counted)


def dump_config(config: Config) -> dict[str, Any]:
    """A configuration as plain values, such that ``check_config`` gives it back."""
    return config.model_dump(mode="json")


def _override(document: dict[str, Any], override: str) -> None:
    key, separator, text = override.partition("=")
    steps = steps_of(key.strip())
    if not separator or steps is None:
        raise ConfigError(
            f"--set {shortened(override)}: this is not key=value.",
            "Write, for example, --set fps=20 or --set rig.sensors[0].attributes.fov_deg=60.",
        )
    value = parse_yaml(text, f"--set {shortened(key)}")
    place_value(document, steps, value, f"--set {shortened(override)}")
