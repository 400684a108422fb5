"""How gently a vehicle drives that the Traffic Manager drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Tuple

from carstage.spec.fields import Fields
from carstage.spec.values import Value

COMFORT_RANGES: Dict[str, Tuple[float, float]] = {
    "acceleration_m_s2": (0.5, 3.0),
    "lateral_m_s2": (0.5, 5.0),
    "jerk_m_s3": (0.5, 10.0),
    "gap_s": (0.8, 5.0),
}
"""Least and most of each limit, in the order of :class:`ComfortSpec`."""


@dataclass(frozen=True, eq=False, repr=False)
class ComfortSpec(Value):
    """What the people in a vehicle are to feel at most, as long as nothing surprises it.

    Attributes:
        acceleration_m_s2: along the vehicle, when it gets faster or slower.
        lateral_m_s2: across it, in curves.
        jerk_m_s3: change of the acceleration along it.
        gap_s: time that it stays behind who drives ahead.
    """

    acceleration_m_s2: float = 1.8
    lateral_m_s2: float = 1.8
    jerk_m_s3: float = 2.5
    gap_s: float = 1.6

    @classmethod
    def read(cls, section: Fields) -> ComfortSpec:
        """Check and read the section."""
        return cls(
            *(
                section.number(name, least=least, most=most)
                for name, (least, most) in COMFORT_RANGES.items()
            ),
        )
