"""From dataclasses to what JSON has: objects, lists, numbers and words."""

from __future__ import annotations

from dataclasses import Field, fields, is_dataclass
from typing import Any, Mapping

_LEFT_OUT_AT_DEFAULT = "left_out_at_default"
LEFT_OUT = {_LEFT_OUT_AT_DEFAULT: True}
"""Metadata of a field without a key in the JSON form while it is its default: None, a flag, ()."""


def is_left_out(field: Field[Any], value: Any) -> bool:
    """Whether a field with that value has no key in the JSON form."""
    # By value: not every empty tuple is the same one in Python 3.10.
    same = type(value) is type(field.default) and value == field.default
    return same and _LEFT_OUT_AT_DEFAULT in field.metadata


def plain(value: Any) -> Any:
    """The value as it comes back from JSON: dictionaries for dataclasses, lists for tuples."""
    if value is None or isinstance(value, (str, int, float)):  # first, as most values are
        return value
    if is_dataclass(value):
        return {
            field.name: plain(below)
            for field in fields(value)
            if not is_left_out(field, below := getattr(value, field.name))
        }
    if isinstance(value, Mapping):
        return {key: plain(below) for key, below in value.items()}
    return [plain(below) for below in value] if isinstance(value, (tuple, list)) else value
