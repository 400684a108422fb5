"""What both kinds of MCAP messages share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stamped:
    """A message as it goes into the file.

    Attributes:
        topic: its topic.
        schema: full name of its type.
        data: its bytes.
    """

    topic: str
    schema: str
    data: bytes


def nanoseconds(time_s: float) -> int:
    """Whole nanoseconds since the episode's first frame."""
    return round(time_s * 1e9)
