"""Wheels: tyre and rim, with spokes before the brake disc or a dish of steel as lorries have."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.lofting import ShapeBuilder, uniform
from carstage_sim.mesh import Material

_STEEL_SEGMENTS = 20
_COARSE_SEGMENTS = 12


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
        spokes: of the rim; 0 is a dish of steel with a hub.
    """
    half = width / 2 * outward
    rim = radius * 0.70
    if not spokes:
        _add_steel_wheel(builder, center, radius, half)
        return
    if builder.coarse:
        _add_coarse_wheel(builder, center, radius, half, spokes)
        return
    segments = spokes * 4
    profile = [
        (0.001, half * 0.26),
        (rim * 0.62, half * 0.26),
        (rim * 0.64, half * 0.06),
        (rim * 0.93, half * 0.10),
        (rim * 0.95, half * 0.86),
        (rim, half * 0.94),
        (radius * 0.90, half),
        (radius, half * 0.72),
        (radius, -half * 0.72),
        (radius * 0.86, -half),
        (0.001, -half * 0.6),
    ]
    materials = uniform(Material.RUBBER, len(profile) - 1, segments)
    materials[0] = Material.METAL
    materials[1:4] = Material.PLASTIC_DARK
    materials[4] = Material.RIM
    materials[9] = Material.PLASTIC_DARK
    builder.lathe(center, profile, materials, segments=segments)
    cap = [(0.001, half * 0.80), (rim * 0.20, half * 0.76), (rim * 0.24, half * 0.40)]
    rows = uniform(Material.RIM, 2, spokes * 2)
    builder.lathe(center, cap, rows, segments=spokes * 2)
    for k in range(spokes):
        _add_spoke(builder, center, 2 * np.pi * (k + 0.5) / spokes, rim, half)


def _add_coarse_wheel(
    builder: ShapeBuilder,
    center: tuple[float, float, float],
    radius: float,
    half: float,
    spokes: int,
) -> None:
    """The same wheel from a few metres: no hub of its own, spokes without cheeks."""
    rim = radius * 0.70
    profile = [
        (0.001, half * 0.80),
        (rim * 0.22, half * 0.76),
        (rim * 0.24, half * 0.10),
        (rim * 0.62, half * 0.10),
        (rim * 0.93, half * 0.10),
        (rim * 0.95, half * 0.86),
        (rim, half * 0.94),
        (radius * 0.92, half),
        (radius, half * 0.72),
        (radius, -half * 0.9),
        (0.001, -half * 0.8),
    ]
    materials = uniform(Material.RUBBER, len(profile) - 1, _COARSE_SEGMENTS)
    materials[:2] = Material.RIM
    materials[2] = Material.METAL
    materials[3:5] = Material.PLASTIC_DARK
    materials[5] = Material.RIM
    materials[9] = Material.PLASTIC_DARK
    builder.lathe(center, profile, materials, segments=_COARSE_SEGMENTS)
    turn = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
    along = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    aside = np.stack([-np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    for k in range(spokes):
        ends = [
            [along[k] * away * rim + sign * wide * rim * aside[k] for sign in (1.0, -1.0)]
            for away, wide in ((0.16, 0.10), (0.97, 0.15))
        ]
        out = np.array([0.0, half * 0.80, 0.0])
        builder.grid(np.array(ends) + out + np.asarray(center), Material.RIM)


def _add_steel_wheel(
    builder: ShapeBuilder, center: tuple[float, float, float], radius: float, half: float
) -> None:
    """A lorry's wheel; ``half`` is half its width, signed as its outer side."""
    rim = radius * 0.66
    profile = [
        (0.001, half * 0.84),
        (rim * 0.30, half * 0.80),
        (rim * 0.34, half * 0.30),
        (rim * 0.46, half * 0.26),
        (rim * 0.80, half * 0.34),
        (rim * 0.88, half * 0.10),
        (rim * 0.95, half * 0.88),
        (rim, half * 0.94),
        (radius * 0.91, half),
        (radius, half * 0.72),
        (radius, -half * 0.72),
        (radius * 0.86, -half),
        (0.001, -half * 0.6),
    ]
    segments = _COARSE_SEGMENTS if builder.coarse else _STEEL_SEGMENTS
    materials = uniform(Material.RUBBER, len(profile) - 1, segments)
    materials[0] = Material.METAL
    materials[1:3] = Material.PLASTIC_DARK
    materials[3] = Material.RIM
    materials[4] = Material.PLASTIC_DARK
    materials[5:7] = Material.RIM
    materials[11] = Material.PLASTIC_DARK
    builder.lathe(center, profile, materials, segments=segments)


def _add_spoke(
    builder: ShapeBuilder, center: tuple[float, float, float], turn: float, rim: float, half: float
) -> None:
    """A bar from the hub to the rim, wider at the rim, with cheeks that show its depth."""
    along = np.array([np.cos(turn), 0.0, np.sin(turn)])
    aside = np.array([-np.sin(turn), 0.0, np.cos(turn)])
    out = np.array([0.0, 1.0, 0.0])
    rows = []
    for away, wide, front in ((0.16, 0.09, 0.72), (0.60, 0.085, 0.84), (0.97, 0.14, 0.84)):
        middle = along * away * rim + np.asarray(center)
        left, right = aside * wide * rim, -aside * wide * rim
        back = out * half * 0.45
        face = out * half * front
        rows.append(
            [
                middle + left * 1.2 + back,
                middle + left + face,
                middle + right + face,
                middle + right * 1.2 + back,
            ]
        )
    quads = np.full((2, 3), Material.PLASTIC_DARK)
    quads[:, 1] = Material.RIM
    builder.grid(np.array(rows), quads, crease_deg=30)
