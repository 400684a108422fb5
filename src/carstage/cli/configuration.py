"""A command's configuration: a file, or standard input."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from carstage.config import Config


def read_configuration(path: Path, overrides: Sequence[str]) -> Config:
    """The configuration that a command was given.

    Args:
        path: of a YAML file; ``-``: standard input.
        overrides: as of ``--set``.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong.
    """
    from carstage.config import load_config, parse_config

    if str(path) == "-":
        return parse_config(sys.stdin.read(), overrides, source="standard input")
    return load_config(path, overrides)
