"""Heads with faces, hair in several styles, and what covers them."""

from __future__ import annotations

from typing import Literal

import numpy as np

from carstage_sim.content.lofting import Array, Curve
from carstage_sim.content.posing import Chain, Parts
from carstage_sim.mesh import Material

Hair = Literal[
    "short", "fade", "curly", "bob", "long", "bun", "ponytail", "bald", "cap", "beanie", "hat",
    "sun hat", "scarf", "helmet",
]  # fmt: skip

_HEAD = (Chain.HEAD, 0.0)
_SIDES = 12
EYE = (0.075, 0.03, 0.010)
"""Place of an eye from the middle of a head: ahead, aside, up; metres of a figure of 1.8 m."""

# Heights of an adult's head and what they are in a child's: the forehead takes room of the face.
_HEIGHTS = (-0.30, -0.116, -0.066, -0.030, 0.010, 0.035, 0.100, 0.30)
_YOUNG_HEIGHTS = (-0.30, -0.116, -0.080, -0.050, -0.014, 0.014, 0.100, 0.30)
_YOUNG_SIZE = 0.36
"""How much larger than an adult's the head of a small child is."""
_NOSE = (0.086, 0.026)
"""What is before this, and nearer to the middle than that, is the nose."""

# Height from the middle of the head, half width, front, back.
_SKULL = [
    (-0.116, 0.020, 0.076, -0.040), (-0.100, 0.042, 0.089, -0.010), (-0.066, 0.058, 0.088, 0.042),
    (-0.030, 0.067, 0.085, 0.074), (0.006, 0.072, 0.081, 0.090), (0.034, 0.073, 0.089, 0.096),
    (0.074, 0.067, 0.081, 0.093), (0.104, 0.038, 0.044, 0.056),
]  # fmt: skip
_WIDE, _FRONT, _BACK = (Curve([(row[0], row[column]) for row in _SKULL]) for column in (1, 2, 3))


def _youth(size: float) -> float:
    """0 for an adult's head, 1 for one of the size of a small child's."""
    return min(max((size - 1.0) / _YOUNG_SIZE, 0.0), 1.0)


def resized(points: Array, size: float) -> Array:
    """Points of an adult's head ``(..., 3)`` in a head of another size.

    Children have low and wide faces, broad cheeks and small noses and chins.
    """
    youth = _youth(size)
    if youth == 0.0:
        return points * size
    x, y, z = np.moveaxis(points, -1, 0)
    low = np.interp(z, _HEIGHTS, _YOUNG_HEIGHTS)
    cheeks = np.interp(z, (-0.116, -0.066, -0.01, 0.10), (0.05, 0.16, 0.09, 0.05))
    nose = (x > _NOSE[0]) & (np.abs(y) < _NOSE[1]) & (z < 0.03) & (z > -0.05)
    ahead = np.where(nose, _NOSE[0] + 0.5 * (x - _NOSE[0]), x)
    ahead -= np.interp(z, (-0.116, -0.085), (0.010, 0.0)) * (x > 0.0)
    young = np.stack([ahead, y * (1.0 + cheeks), low], axis=-1)
    moved: Array = (points + youth * (young - points)) * size
    return moved


def eye_at(size: float) -> Array:
    """Place of an eye in a head of a size, as :data:`EYE`."""
    return resized(np.array(EYE), size)


def _skin(height: Array, angle: Array, grown: float = 0.0) -> Array:
    """Points of the head's surface, or above it, at heights and angles from the front."""
    c, s = np.cos(angle), np.sin(angle)
    ahead = np.where(c > 0, c * (_FRONT(height) + grown), c * (_BACK(height) + grown))
    return np.stack([ahead, s * (_WIDE(height) + grown), height + 0.0 * angle], axis=-1)


def _face(y: Array, z: Array, above: float) -> Array:
    """Points of the face at places seen from the front."""
    sine = np.clip(y / _WIDE(z), -0.95, 0.95)
    ahead = _FRONT(z) * np.sqrt(1.0 - sine**2) + above
    return np.stack([ahead, y, z], axis=-1)


def add_head(parts: Parts, hair: Hair, cover: Material, size: float) -> None:
    """Add a head in the frame of :data:`Chain.HEAD`; ``size`` is that over an adult's."""
    angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    rings = np.stack([_skin(np.full(_SIDES, row[0]), angle) for row in _SKULL])
    # The back of the lowest rings is in front of the neck.
    _loft(parts, rings, size, Material.SKIN)
    _add_face(parts, size)
    for sign in () if hair in ("bob", "long", "scarf") else (-1.0, 1.0):
        ear = np.array([(-0.012, 0.066, -0.034), (-0.004, 0.074, -0.012), (-0.010, 0.076, 0.018),
                        (-0.024, 0.066, 0.012)])  # fmt: skip
        rim = ear + np.array([-0.016, 0.012, 0.002])
        both = np.stack([ear, rim]) * np.array([1.0, sign, 1.0])
        _loft(parts, both, size, Material.SKIN, capped=True)
    _add_hair(parts, hair, cover, size)


def _loft(
    parts: Parts, rings: Array, size: float, material: object, *, closed: bool = True,
    capped: bool = True,
) -> None:  # fmt: skip
    points = resized(rings, size)
    parts.loft([_HEAD] * len(rings), points, np.asarray(material), closed=closed, capped=capped)


def _add_face(parts: Parts, size: float) -> None:
    def patch(ys: list[float], zs: list[list[float]], above: float, material: Material) -> None:
        y = np.broadcast_to(np.array(ys), (len(zs), len(ys)))
        _loft(parts, _face(y, np.array(zs), above), size, material, closed=False, capped=False)

    nose = np.array([
        [(0.084, -0.008, 0.022), (0.092, 0.0, 0.024), (0.084, 0.008, 0.022)],
        [(0.086, -0.012, -0.008), (0.104, 0.0, -0.006), (0.086, 0.012, -0.008)],
        [(0.085, -0.018, -0.026), (0.112, 0.0, -0.028), (0.085, 0.018, -0.026)],
        [(0.085, -0.014, -0.036), (0.090, 0.0, -0.038), (0.085, 0.014, -0.036)],
    ])  # fmt: skip
    _loft(parts, nose, size, Material.SKIN, closed=False, capped=False)
    patch([-0.024, 0.0, 0.024], [[-0.067, -0.070, -0.067], [-0.064, -0.059, -0.064]], 0.004,
          Material.LIPS)  # fmt: skip
    wide = 0.15 * _youth(size)
    for sign in (-1.0, 1.0):
        eye, iris = (
            [sign * (v + wide * (v - EYE[1])) for v in ys]
            for ys in ((0.018, 0.031, 0.045), (0.0255, 0.0365))
        )
        patch(eye, [[0.007, 0.000, 0.007], [0.010, 0.016, 0.010]], 0.0035, Material.SIGN_WHITE)
        patch(iris, [[0.002, 0.002], [0.015, 0.015]], 0.0050, Material.RUBBER)
        brow = [sign * v for v in (0.014, 0.032, 0.051)]
        patch(brow, [[0.025, 0.030, 0.024], [0.032, 0.037, 0.029]], 0.0045, Material.HAIR)


def _shell(
    parts: Parts,
    hem: tuple[float, float, float],
    grown: float,
    material: Material,
    size: float,
    *,
    hang: float = 0.0,
    rough: float = 0.0,
) -> None:
    """A cover over the skull, down to heights at the front, the sides and the back.

    Args:
        parts: of the figure.
        hem: height of its lower edge at the front, over the ears and at the back.
        grown: how far it is above the skin.
        material: of all of it.
        size: of the head.
        hang: below the widest place it hangs this far from the middle.
        rough: how much its surface goes up and down.
    """
    angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    edge = Curve([(0.0, hem[0]), (0.85, hem[0]), (1.35, hem[1]), (1.9, hem[1]), (2.6, hem[2]),
                  (np.pi, hem[2])])(np.minimum(angle, 2 * np.pi - angle))  # fmt: skip
    rows: list[Array] = []
    for share in (0.0, 0.5, 1.0):
        height = edge + (0.084 - edge) * share
        row = _skin(np.maximum(height, -0.03), angle, grown * (0.55 if share in (0.0,) else 1.0))
        row[:, 2] = height
        if hang:
            low = np.clip((0.0 - height) / 0.1, 0.0, 1.0)
            row[:, 0] -= hang * low
            row[:, 1] *= 1.0 + 0.30 * low
        if rough:
            row[:, :2] *= 1.0 + rough * ((np.arange(_SIDES) + len(rows)) % 2)[:, None]
        rows.append(row)
    for lift, away in ((0.103, 1.0), (0.113, 0.40)):
        row = _skin(np.full(_SIDES, 0.100), angle, grown * 0.8) * np.array([away, away, 1.0])
        row[:, 2] = lift + min(grown, 0.010)
        rows.append(row)
    inner = rows[0] * np.array([0.93, 0.93, 1.0])
    _loft(parts, np.stack([inner, *rows]), size, material)


def _add_hair(parts: Parts, hair: Hair, cover: Material, size: float) -> None:
    own = Material.HAIR
    styles: dict[str, tuple[tuple[float, float, float], float, float, float]] = {
        "short": ((0.068, 0.000, -0.066), 0.012, 0.0, 0.0),
        "fade": ((0.072, 0.030, -0.030), 0.007, 0.0, 0.0),
        "curly": ((0.062, -0.010, -0.075), 0.020, 0.0, 0.06),
        "bob": ((0.062, -0.085, -0.105), 0.017, 0.0, 0.0),
        "long": ((0.066, -0.145, -0.195), 0.016, 0.012, 0.0),
        "bun": ((0.066, 0.000, -0.070), 0.010, 0.0, 0.0),
        "ponytail": ((0.066, 0.000, -0.070), 0.010, 0.0, 0.0),
        "cap": ((0.040, -0.004, -0.066), 0.008, 0.0, 0.0),
        "beanie": ((0.020, -0.030, -0.075), 0.006, 0.0, 0.0),
        "hat": ((0.040, -0.020, -0.080), 0.010, 0.0, 0.0),
        "sun hat": ((0.040, -0.145, -0.185), 0.014, 0.012, 0.0),
    }
    if hair in styles:
        hem, grown, hang, rough = styles[hair]
        _shell(parts, hem, grown, own, size, hang=hang, rough=rough)
    if hair == "bald":
        _shell(parts, (-0.02, 0.0, -0.05), -0.002, Material.SKIN, size)
    elif hair == "bun":
        _ball(parts, (-0.112, 0.0, 0.055), 0.042, own, size)
    elif hair == "ponytail":
        rows = [(-0.085, 0.060, 0.022), (-0.118, 0.030, 0.030), (-0.132, -0.050, 0.030),
                (-0.125, -0.130, 0.020), (-0.118, -0.175, 0.006)]  # fmt: skip
        around = 2.0 * np.pi * np.arange(6) / 6
        rings = [
            np.stack([x + r * 0.7 * np.cos(around), r * np.sin(around), np.full(6, z)], axis=-1)
            for x, z, r in rows
        ]
        _loft(parts, np.stack(rings), size, own)
    elif hair == "cap":
        _shell(parts, (0.052, 0.040, 0.020), 0.014, cover, size)
        peak = np.array(
            [
                [(0.080, -0.060, 0.058), (0.098, 0.0, 0.062), (0.080, 0.060, 0.058)],
                [(0.135, -0.045, 0.044), (0.158, 0.0, 0.044), (0.135, 0.045, 0.044)],
            ]
        )
        _loft(parts, peak, size, cover, closed=False, capped=False)
    elif hair == "beanie":
        _shell(parts, (0.046, 0.022, -0.010), 0.016, cover, size)
    elif hair == "hat":
        _add_hat(parts, cover, size, brim_m=0.060)
    elif hair == "sun hat":
        _add_hat(parts, cover, size, brim_m=0.125)
    elif hair == "scarf":
        _shell(parts, (0.062, -0.10, -0.19), 0.016, cover, size)
        angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
        rows = [(-0.225, 0.115, 0.092), (-0.165, 0.082, 0.078), (-0.118, 0.074, 0.066)]
        rings = [
            np.stack([deep * np.cos(angle), wide * np.sin(angle), np.full(_SIDES, z)], axis=-1)
            for z, wide, deep in rows
        ]
        _loft(parts, np.stack(rings), size, cover)
    elif hair == "helmet":
        _shell(parts, (0.050, 0.018, 0.006), 0.022, cover, size)


def _add_hat(parts: Parts, cover: Material, size: float, *, brim_m: float) -> None:
    """A hat whose brim stands out from the head and hangs a little."""
    _shell(parts, (0.058, 0.050, 0.046), 0.013 if brim_m < 0.1 else 0.017, cover, size)
    angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    brim = [_skin(np.full(_SIDES, 0.055), angle, more) for more in (0.008, brim_m, 0.0)]
    brim[1][:, 2] = 0.055 - 0.15 * brim_m
    brim[2][:, 2] = 0.050
    _loft(parts, np.stack(brim), size, cover, capped=False)


def _ball(
    parts: Parts, middle: tuple[float, float, float], radius: float, material: Material, size: float
) -> None:
    around = 2.0 * np.pi * np.arange(7) / 7
    rings = []
    for lift in (-0.92, -0.4, 0.4, 0.92):
        wide = radius * float(np.sqrt(1 - lift * lift))
        ring = [wide * np.cos(around), wide * np.sin(around), np.full(7, lift * radius)]
        rings.append(np.stack(ring, axis=-1) + np.array(middle))
    _loft(parts, np.stack(rings), size, material)
