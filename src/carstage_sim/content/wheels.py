"""Wheels: tyre and spoked rim, turned about their axle."""

from __future__ import annotations

from carstage_sim.content.lofting import ShapeBuilder, uniform
from carstage_sim.mesh import Material


def add_wheel(
    builder: ShapeBuilder,
    center: tuple[float, float, float],
    radius: float,
    width: float,
    *,
    outward: float,
    spokes: int = 5,
) -> None:
    """Add a wheel whose axle is along y.

    Args:
        builder: receives it.
        center: of the wheel, metres.
        radius: of the tyre, metres.
        width: of the tyre, metres.
        outward: sign of y on which the rim shows.
        spokes: of the rim.
    """
    segments = spokes * 4
    half = width / 2 * outward
    rim = radius * 0.68
    profile = [
        (0.001, half * 0.62),
        (rim * 0.22, half * 0.66),
        (rim * 0.86, half * 0.86),
        (rim, half * 0.92),
        (radius * 0.90, half),
        (radius, half * 0.72),
        (radius, -half * 0.72),
        (radius * 0.86, -half),
        (0.001, -half * 0.6),
    ]
    materials = uniform(Material.RUBBER, len(profile) - 1, segments)
    materials[:3] = Material.RIM
    spoke_gap = [k for k in range(segments) if k % 4 in (2, 3)]
    materials[1, spoke_gap] = Material.PLASTIC_DARK
    materials[7] = Material.PLASTIC_DARK
    builder.lathe(center, profile, materials, segments=segments)
