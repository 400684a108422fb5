"""What both kinds of MCAP messages share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

EGO_SIGNALS: Final = (
    "throttle", "steer", "brake", "hand_brake", "reverse", "gear", "speed_limit_kmh",
    "traffic_light_state", "weather_preset", "weather",
)  # fmt: skip
"""Columns of ``ego.parquet`` that go over as they are; a null is left out."""
OBJECT_FACTS: Final = ("class", "blueprint", "role_name", "traffic_light_state")
"""Columns of ``objects.parquet`` that a 3D box is described by; what is empty is left out."""


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
