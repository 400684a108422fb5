"""Reads a sensor's attributes, which clients send as text."""

from __future__ import annotations

import math
from collections.abc import Mapping


class SensorAttributeError(ValueError):
    """An attribute of a sensor has a value that it cannot work with."""


def number(attributes: Mapping[str, str], name: str, default: float) -> float:
    """A finite float attribute, ``default`` when the client did not send it.

    Raises:
        SensorAttributeError: the text is not a finite number.
    """
    text = attributes.get(name)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SensorAttributeError(f"sensor attribute {name} is {text!r}, not a finite number")
    return value


def whole(attributes: Mapping[str, str], name: str, default: int) -> int:
    """An integer attribute, ``default`` when the client did not send it.

    Raises:
        SensorAttributeError: the text is not a whole number.
    """
    value = number(attributes, name, default)
    if value != int(value):
        raise SensorAttributeError(f"sensor attribute {name} is {value}, not a whole number")
    return int(value)


def flag(attributes: Mapping[str, str], name: str, *, default: bool) -> bool:
    """A boolean attribute, ``default`` when the client did not send it.

    Raises:
        SensorAttributeError: the text is neither true nor false, in whatever case.
    """
    text = attributes.get(name, str(default)).lower()
    if text not in ("true", "false"):
        raise SensorAttributeError(f"sensor attribute {name} is {text!r}, not true or false")
    return text == "true"


def within(name: str, value: float, lowest: float, highest: float) -> None:
    """Refuse a value outside of what the simulator can compute, naming the attribute.

    Raises:
        SensorAttributeError: it is below ``lowest`` or above ``highest``.
    """
    require(lowest <= value <= highest, f"{name} is {value:g}, not {lowest:g} to {highest:g}")


def require(condition: bool, message: str) -> None:
    """Refuse a value.

    Raises:
        SensorAttributeError: the condition does not hold.
    """
    if not condition:
        raise SensorAttributeError(message)
