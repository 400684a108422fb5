"""JSON that others may have written."""

from __future__ import annotations

import json
import math
from typing import Any, Final

_MOST_DIGITS: Final = 40


def parse_json(content: bytes | str) -> Any:
    """A document whose numbers are finite and of a size that ours have.

    Raises:
        ValueError: it is no JSON, is nested too deeply, or has another number.
    """
    try:
        return json.loads(content, parse_int=_integer, parse_float=_number, parse_constant=_number)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"the number {text}")
    return number
