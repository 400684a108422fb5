"""What all classes of the specification are: values, equal where their content is."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Tuple


class Value:
    """Base of the dataclasses of the specification, and of a run's events.

    They are made with ``eq=False, repr=False``. Equality, hash and text are as ``dataclass`` makes
    them, but not made anew for each of some ninety classes: that takes a third of their import, in
    each process.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return _content(self) == _content(other)

    def __hash__(self) -> int:
        return hash(_content(self))

    def __repr__(self) -> str:
        names: Any = fields(self)  # type: ignore[arg-type]
        shown = ", ".join(f"{each.name}={getattr(self, each.name)!r}" for each in names)
        return f"{type(self).__qualname__}({shown})"


def _content(value: Any) -> Tuple[Any, ...]:
    return tuple(getattr(value, each.name) for each in fields(value))
