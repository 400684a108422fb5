"""What a figure holds before its chest in the right hand: a phone, a cup, an open umbrella."""

from __future__ import annotations

from typing import Literal

import numpy as np

from carstage_sim.content.posing import Chain, Parts
from carstage_sim.mesh import Material

Held = Literal["nothing", "phone", "cup", "umbrella"]

_HAND = (Chain.HELD, 0.0)
_RIBS = 8
_MIDDLE = (-0.11, -0.13)
"""Middle of an umbrella, ahead of and to the right of the wrist."""
_CANOPY = ((0.0, 0.012), (-0.022, 0.17), (-0.078, 0.33), (-0.172, 0.45))
"""Rings of an umbrella: height above its top, radius."""
_TOP_M = 0.545
"""Height of an umbrella's top above the wrist of a grown-up of 1.8 m."""


def add_held(parts: Parts, held: Held) -> None:
    """Add what the right hand holds, in the frame of :data:`Chain.HELD`."""
    if held == "phone":
        parts.box(_HAND, (0.045, -0.038, 0.03), (0.056, 0.038, 0.178), Material.PLASTIC_DARK)
    elif held == "cup":
        _add_cup(parts)
    elif held == "umbrella":
        _add_umbrella(parts)


def _add_cup(parts: Parts) -> None:
    angle = 2.0 * np.pi * np.arange(7) / 7
    rows = [(0.0, 0.030), (0.105, 0.041), (0.110, 0.044), (0.124, 0.038)]
    rings = [
        np.stack([0.075 + r * np.cos(angle), r * np.sin(angle) - 0.006, z + 0.0 * angle], axis=-1)
        for z, r in rows
    ]
    material = np.full((3, 7), Material.SIGN_WHITE, np.uint8)
    material[1:] = Material.PLASTIC_DARK
    parts.loft([_HAND] * len(rows), np.stack(rings), material)


def _add_umbrella(parts: Parts) -> None:
    angle = 2.0 * np.pi * np.arange(2 * _RIBS) / (2 * _RIBS)
    rings = []
    for height, radius in _CANOPY:
        # Cloth hangs through between the ribs.
        share = radius / _CANOPY[-1][1]
        reach = radius * np.where(np.arange(2 * _RIBS) % 2, 1.0 - 0.055 * share, 1.0)
        x, y = _MIDDLE[0] + reach * np.cos(angle), _MIDDLE[1] + reach * np.sin(angle)
        z = _TOP_M + height + 0.018 * share * (np.arange(2 * _RIBS) % 2)
        rings.append(np.stack([x, y, z], axis=-1))
    parts.loft([_HAND] * len(rings), np.stack(rings), Material.BAG, capped=False)
    ends = ((0.050, -0.002, -0.075), (0.050, -0.002, 0.03), (*_MIDDLE, _TOP_M + 0.006))
    corner = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)])
    shaft = np.stack([np.array(end) + corner * r for end, r in zip(ends, (0.016, 0.012, 0.007),
                                                                   strict=True)])  # fmt: skip
    parts.loft([_HAND] * 3, shaft, Material.PLASTIC_DARK)
