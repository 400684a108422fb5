"""Cubic polynomials of the distance along a road, as OpenDRIVE has widths and heights."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cubic:
    """``a + b ds + c ds² + d ds³`` with ``ds`` the distance from ``start_m`` on.

    Attributes:
        start_m: where the piece begins; for lane widths from the lane section's start.
        a, b, c, d: coefficients; the value is in metres.
    """

    start_m: float
    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0

    def value(self, s_m: float) -> float:
        """Value at ``s_m`` in metres."""
        ds = s_m - self.start_m
        return self.a + ds * (self.b + ds * (self.c + ds * self.d))

    def slope(self, s_m: float) -> float:
        """Derivative at ``s_m``."""
        ds = s_m - self.start_m
        return self.b + ds * (2 * self.c + ds * 3 * self.d)


def eased(
    start_m: float,
    length_m: float,
    values_m: tuple[float, float],
    slopes: tuple[float, float] = (0.0, 0.0),
) -> Cubic:
    """The cubic with these values and slopes at its two ends (Hermite form)."""
    first, last = values_m
    mean = (last - first) / length_m
    return Cubic(
        start_m,
        first,
        slopes[0],
        (3 * mean - 2 * slopes[0] - slopes[1]) / length_m,
        (slopes[0] + slopes[1] - 2 * mean) / length_m**2,
    )
