"""A share of a plan, for one of several machines that fill a dataset together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from carstage.errors import BadInputError

_FORM = re.compile(r"([0-9]{1,6})/([0-9]{1,6})")

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Shard:
    """One of several shares.

    Which share an episode belongs to follows from its place in the plan alone. So all machines
    agree without a word, and more episodes do not move the first ones to other shares.

    Attributes:
        number: which one, from 1.
        count: how many there are.
    """

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            raise BadInputError(
                f"shard: {self} is not one of {self.count} shares.",
                "Write I/N with I from 1 to N.",
            )

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @classmethod
    def parse(cls, text: str) -> Shard:
        """A share as users write it, ``2/8``.

        Raises:
            BadInputError: it is not written so.
        """
        found = _FORM.fullmatch(text.strip())
        if found is None:
            raise BadInputError(
                f"shard: {text[:40]!r} is not a share.",
                "Write I/N with I from 1 to N, such as 2/8.",
            )
        return cls(int(found[1]), int(found[2]))

    @property
    def places(self) -> slice:
        """Places in the plan of its share: every N-th from the I-th on."""
        return slice(self.number - 1, None, self.count)

    def share(self, items: Sequence[Item]) -> tuple[Item, ...]:
        """The items of its share."""
        return tuple(items[self.places])
