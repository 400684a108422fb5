"""Light that comes to a surface before any is reflected: the sky, what covers it, the sun."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device, inlined
from carstage_sim.render.arithmetic import elevation, turns
from carstage_sim.render.cast import NOTHING, trace

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
OVER_PI: Any = np.float32(1 / math.pi)
"""Radiance of a matt white surface for each unit of irradiance, 1/sr."""
_LEAST_SUN: Any = np.float32(1e-6)
"""Irradiance of the sun, all channels together, from which it casts shadows."""
RAY_NEAR_M: Any = np.float32(1e-3)
"""Rays from a surface begin so far from their origin."""
SHADOW_M: Any = np.float32(300.0)
"""What stands farther towards the sun casts no shadow."""
_OPENNESS_M: Any = np.float32(3.0)
"""What is farther covers no sky, quality epic."""
OVERHANG_M: Any = np.float32(0.7)
"""What is higher above the ground keeps no light of the sky off it, quality low."""
_LEAF_LIFT_M: Any = np.float32(0.25)
"""Rays to the sun leave a crown's outer leaves so far ahead."""
_UNDER_CARS: Any = np.float32(0.08)
"""Share of the sky's light on ground that something touches."""
_UNDER_RISE_PER_M: Any = np.float32(0.6)
"""How that share grows with the height of what is above.

Under a strip ``2 a`` wide at height ``h`` the mean share is
``1 - (sqrt(4 a^2 + h^2) - h) / (2 a)``, under a car of 1.8 m with a gap of 0.25 m 0.13; its ends
and what the street throws back add to it.
"""


@inlined
def sun_is_up(light):  # type: ignore[no-untyped-def]
    """Whether the sun lights anything."""
    return light.sun[0] + light.sun[1] + light.sun[2] > _LEAST_SUN


@inlined
def sky_place(light, x, y, z):  # type: ignore[no-untyped-def]
    """Row and column of the sky's table in a unit direction; below the horizon, those of it."""
    rows, columns = light.sky.shape[0], light.sky.shape[1]
    row = math.sqrt(elevation(min(max(z, _ZERO), _ONE))) * np.float32(rows - 1)
    turn = turns(y, x)
    return row, (turn if turn >= 0 else turn + _ONE) * np.float32(columns)


@inlined
def radiance_at(light, row, column):  # type: ignore[no-untyped-def]
    """Radiance of the sky between four places of its table."""
    rows, columns = light.sky.shape[0], light.sky.shape[1]
    i = min(int(row), rows - 2)
    j = min(int(column), columns - 1)
    k = j + 1 if j + 1 < columns else 0
    a = row - np.float32(i)
    b = column - np.float32(j)
    p = light.sky
    low0 = p[i, j, 0] + (p[i, k, 0] - p[i, j, 0]) * b
    low1 = p[i, j, 1] + (p[i, k, 1] - p[i, j, 1]) * b
    low2 = p[i, j, 2] + (p[i, k, 2] - p[i, j, 2]) * b
    i += 1
    high0 = p[i, j, 0] + (p[i, k, 0] - p[i, j, 0]) * b
    high1 = p[i, j, 1] + (p[i, k, 1] - p[i, j, 1]) * b
    high2 = p[i, j, 2] + (p[i, k, 2] - p[i, j, 2]) * b
    return low0 + (high0 - low0) * a, low1 + (high1 - low1) * a, low2 + (high2 - low2) * a


@device
def sky_radiance(light, x, y, z):  # type: ignore[no-untyped-def]
    """Radiance of the sky in a unit direction; below the horizon that of the horizon."""
    row, column = sky_place(light, x, y, z)
    return radiance_at(light, row, column)


@inlined
def sky_irradiance(light, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Irradiance from above, the side and below, mixed by the normal."""
    up = max(nz, _ZERO)
    up = up * up
    down = max(-nz, _ZERO)
    down = down * down
    side = _ONE - up - down
    a = light.ambient
    return (
        a[0, 0] * up + a[1, 0] * side + a[2, 0] * down,
        a[0, 1] * up + a[1, 1] * side + a[2, 1] * down,
        a[0, 2] * up + a[1, 2] * side + a[2, 2] * down,
    )


@inlined
def openness(scene, scratch, o, nx, ny, nz, skip):  # type: ignore[no-untyped-def]
    """Share of the sky above a surface that nothing near covers, from three rays, 0.2-1."""
    # Two tangents of the normal (Duff et al., JCGT 2017).
    sign = _ONE if nz >= 0 else -_ONE
    a = -_ONE / (sign + nz)
    b = nx * ny * a
    tx, ty, tz = _ONE + sign * nx * nx * a, sign * b, -sign * nx
    bx, by, bz = b, sign + ny * ny * a, -ny
    total = _ZERO
    for k in range(3):
        # Three directions around the normal, 120 degrees apart, 53 degrees off it.
        across = np.float32(0.8) if k == 0 else np.float32(-0.4)
        along = _ZERO if k == 0 else (np.float32(0.69) if k == 1 else np.float32(-0.69))
        ray = (
            nx * np.float32(0.6) + tx * across + bx * along,
            ny * np.float32(0.6) + ty * across + by * along,
            nz * np.float32(0.6) + tz * across + bz * along,
        )
        hit = trace(scene, scratch, o, ray, RAY_NEAR_M, _OPENNESS_M, skip, False)
        total += min(hit[0] * np.float32(1 / 3), _ONE)
    return np.float32(0.2) + np.float32(0.8 / 3) * total


@device
def overhang_way():  # type: ignore[no-untyped-def]
    """Direction in which what covers the ground is looked for: upwards, a little aslant."""
    return np.float32(0.1186723), np.float32(0.0890042), np.float32(0.988936)


@device
def overhang_share(distance):  # type: ignore[no-untyped-def]
    """Share of the sky's light that what is so far above leaves to the ground."""
    return _UNDER_CARS + _UNDER_RISE_PER_M * distance


@inlined
def under_overhang(scene, scratch, o, skip):  # type: ignore[no-untyped-def]
    """Share of the sky's light that what stands right above leaves to the ground, from one ray."""
    hit = trace(scene, scratch, o, overhang_way(), RAY_NEAR_M, OVERHANG_M, skip, False)
    if hit[1] == NOTHING:
        return _ONE
    return overhang_share(hit[0])


@device
def sun_may_reach(light, n, g, leaves):  # type: ignore[no-untyped-def]
    """Whether a surface is turned so that the sun may light it, dry or wet.

    Args:
        light: a :class:`carstage_sim.render.sky.Lighting`.
        n, g: shading normal, before water bends it, and triangle's normal.
        leaves: those are lit from behind, too.
    """
    if not sun_is_up(light):
        return False
    if leaves:
        return True
    s = light.sun_direction
    if g[0] * s[0] + g[1] * s[1] + g[2] * s[2] <= 0:
        return False
    return light.wetness > 0 or n[0] * s[0] + n[1] * s[1] + n[2] * s[2] > 0


@inlined
def sun_start(light, p, o, leaves):  # type: ignore[no-untyped-def]
    """Where a ray to the sun begins.

    Args:
        light: a :class:`carstage_sim.render.sky.Lighting`.
        p: place on the surface.
        o: the same, lifted off it.
        leaves: whose crown must not shade itself through and through.
    """
    s = light.sun_direction
    if leaves:
        return p[0] + s[0] * _LEAF_LIFT_M, p[1] + s[1] * _LEAF_LIFT_M, p[2] + s[2] * _LEAF_LIFT_M
    return o


@inlined
def sees_sun(scene, scratch, light, o, skip):  # type: ignore[no-untyped-def]
    """Whether nothing stands between a place and the sun."""
    to_sun = (light.sun_direction[0], light.sun_direction[1], light.sun_direction[2])
    return trace(scene, scratch, o, to_sun, RAY_NEAR_M, SHADOW_M, skip, True)[1] == NOTHING
