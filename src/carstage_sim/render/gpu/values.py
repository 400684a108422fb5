"""What a translated kernel computes with: values on the card, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Scalar = str
"""``f32``, ``i32``, ``u32`` or ``bool``."""
Type = str | tuple[str, ...]
"""A scalar, or a tuple of scalars."""

_RANK = {"bool": 0, "i32": 1, "u32": 2, "f32": 3}


class TranslationError(NotImplementedError):
    """A kernel uses something that is not translated; the message says what and where."""


@dataclass(frozen=True, slots=True)
class Value:
    """An expression on the card."""

    code: str
    type: Type


@dataclass(frozen=True, slots=True)
class Array:
    """An array whose elements ``read(i, j, ...)`` gives and ``write(i, j, ..., value)`` takes.

    Attributes:
        read: name of a WGSL function.
        scalar: what it returns.
        axes: number of indices.
        sizes: WGSL expressions of the shape.
        write: name of a WGSL function, empty for arrays that are only read.
    """

    read: str
    scalar: Scalar
    axes: int
    sizes: tuple[str, ...] = ()
    write: str = ""


@dataclass(frozen=True, slots=True)
class Record:
    """A named tuple whose fields are found when they are asked for.

    Attributes:
        name: tells it from others.
        member: gives the field of a name, which may be a record too.
    """

    name: str
    member: Callable[[str], Value | Array | Record]


@dataclass(frozen=True, slots=True)
class Either:
    """One of two records or arrays, told apart on the card by a condition."""

    condition: str
    first: Record | Array
    second: Record | Array


Static = Array | Record | Either
Bound = Value | Static
External = Callable[[Sequence[Bound]], Value]
"""Gives the code of a call of a function that is written in WGSL."""


def tuple_name(types: Sequence[Scalar]) -> str:
    """Name of the WGSL structure for a tuple; its members are ``m0``, ``m1``, ..."""
    return "Tuple_" + "".join(t[0] for t in types)


def join(a: Type, b: Type) -> Type:
    """The type that holds values of both."""
    if isinstance(a, str) and isinstance(b, str):
        return a if _RANK[a] >= _RANK[b] else b
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        return tuple(str(join(x, y)) for x, y in zip(a, b, strict=True))
    raise TranslationError(f"a value is {a} here and {b} there")


def convert(value: Value, wanted: Type) -> str:
    """Code of a value as another type."""
    if value.type == wanted:
        return value.code
    if isinstance(wanted, tuple):
        if not isinstance(value.type, tuple):
            raise TranslationError(f"{value.code} is no tuple")
        parts = (
            convert(Value(f"({value.code}).m{k}", have), want)
            for k, (have, want) in enumerate(zip(value.type, wanted, strict=True))
        )
        return f"{tuple_name(wanted)}({', '.join(parts)})"
    if isinstance(value.type, tuple):
        raise TranslationError(f"{value.code} is a tuple")
    return f"{wanted}({value.code})"


def constant(number: Any) -> Value:
    """A number of Python's or numpy's."""
    if isinstance(number, (bool, np.bool_)):
        return Value(str(bool(number)).lower(), "bool")
    if isinstance(number, np.uint32):
        return Value(f"{int(number)}u", "u32")
    if isinstance(number, (int, np.integer)):
        return Value(f"{int(number)}i" if number >= 0 else f"({int(number)}i)", "i32")
    text = repr(float(np.float32(number)))
    return Value(f"{text}f" if number >= 0 else f"({text}f)", "f32")
