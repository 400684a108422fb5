"""From dataclasses to what JSON has: objects, lists, numbers and words."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, Mapping

_LEFT_OUT_AT_DEFAULT = "left_out_at_default"
LEFT_OUT = {_LEFT_OUT_AT_DEFAULT: True}
"""Metadata of a field that has no key in the JSON form while it is its default, None or a flag."""


def plain(value: Any) -> Any:
    """The value as it comes back from JSON: dictionaries for dataclasses, lists for tuples."""
    if value is None or isinstance(value, (str, int, float)):  # first, as most values are
        return value
    if is_dataclass(value):
        return {
            field.name: plain(below)
            for field in fields(value)
            if (below := getattr(value, field.name)) is not field.default
            or _LEFT_OUT_AT_DEFAULT not in field.metadata
        }
    if isinstance(value, Mapping):
        return {key: plain(below) for key, below in value.items()}
    return [plain(below) for below in value] if isinstance(value, (tuple, list)) else value
