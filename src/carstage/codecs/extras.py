"""Libraries that only some codecs need; they are extras of the package."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from carstage.errors import BadInputError


def need(module: str, *, extra: str, codec: str) -> Any:
    """A module of an extra.

    Raises:
        BadInputError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        raise BadInputError(
            f"conversion.codecs: {codec!r} needs the Python package {module}, which is not here.",
            f"Install the extra: pip install 'carstage[{extra}]'.",
        ) from None
