"""What is between the camera and a surface: fog that thins with height, and falling rain."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device, inlined
from carstage_sim.render.arithmetic import exp_down, exp_of, turns
from carstage_sim.render.detail import hash_unit

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_TAU: Any = np.float32(2 * math.pi)
_RINGS = 3
_CELL_M: Any = np.float32(0.3)
"""Height of the room in which at most one drop falls."""
_STREAK_M: Any = np.float32(0.13)
"""Length of a streak: the way of a drop at 8 m/s in a 60th of a second."""
_STREAK_HALF_M: Any = np.float32(0.003)
"""Half its width."""


@inlined
def fog_share(light, height, rise, distance):  # type: ignore[no-untyped-def]
    """Share of the light from ``distance`` metres away that fog takes, 0-1.

    Exponential height fog: its extinction falls as ``exp(-fall * z)``, integrated along the ray.

    Args:
        light: a :class:`carstage_sim.render.sky.Lighting`.
        height: z of the camera, metres.
        rise: z of the ray's unit direction.
        distance: of the surface.
    """
    length = distance - light.fog_from_m
    if length <= 0:
        return _ZERO
    fall = light.fog_fall_per_m
    start = max(height + rise * light.fog_from_m, np.float32(-200.0))
    drop = fall * rise * length
    # Near zero the quotient loses all digits; its series does not.
    if abs(drop) < np.float32(0.15):
        mean = _ONE - drop * (
            np.float32(1 / 2) - drop * (np.float32(1 / 6) - drop * np.float32(1 / 24))
        )
    else:
        mean = (_ONE - exp_of(-min(max(drop, np.float32(-30.0)), np.float32(30.0)))) / drop
    density = exp_of(min(max(-fall * start, np.float32(-60.0)), np.float32(60.0)))
    return _ONE - exp_down(light.fog_per_m * density * mean * length)


@device
def rain_share(light, dx, dy, dz, distance, pixel_angle):  # type: ignore[no-untyped-def]
    """Share of a pixel that streaks of falling rain cover, 0-1.

    Streaks lie on rings around the camera, nearer than what the ray met. A streak that is narrower
    than the pixel covers a part of it.
    """
    flat = math.sqrt(dx * dx + dy * dy)
    if flat < np.float32(0.2):
        return _ZERO
    rise = dz / flat
    turn = turns(dy, dx)
    turn -= np.floor(turn)
    total = _ZERO
    for ring in range(_RINGS):
        away = np.float32(2.5) * np.float32(2.2) ** ring
        if away > distance * flat:
            break
        columns = 160 * (ring + 1)
        height = away * rise
        # Wind blows the drops along the ring while they fall.
        x = turn * columns + height * light.wind * np.float32(0.35) * columns / (_TAU * away)
        column = math.floor(x)
        shown = column % columns
        speed = np.float32(7.0) + np.float32(2.0) * hash_unit(shown, ring, 51)
        y = (height + light.time_s * speed) / _CELL_M + hash_unit(shown, ring, 52) * 9
        drop = math.floor(y)
        if hash_unit(shown, int(drop), 53 + ring) > light.rain * np.float32(0.6):
            continue
        along = min(np.float32(y - drop) * (_CELL_M / _STREAK_M), _ONE)
        middle = np.float32(0.2) + np.float32(0.6) * hash_unit(shown, int(drop), 60 + ring)
        cell = _TAU * away / columns
        soft = max(away * pixel_angle, _STREAK_HALF_M)
        off = abs(np.float32(x - column) - middle) * cell
        cover = max(_ONE - off / soft, _ZERO) * min(_STREAK_HALF_M / soft * 2, _ONE)
        total += cover * along * (_ONE - along) * 4
    return min(total, _ONE) * np.float32(0.28)
