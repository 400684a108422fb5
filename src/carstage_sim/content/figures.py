"""Human figures in clothes: bodies of pedestrians and riders, in any pose of the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.heads import Hair, add_head
from carstage_sim.content.held import Held, add_held
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.content.posing import ARMS, FEET, LEGS, Chain, Figure, Parts, Pose
from carstage_sim.mesh import Material

HEIGHT_M = 1.80
"""Of the figure that all measures here are of."""
_TRUNK_SIDES, _LEG_SIDES, _ARM_SIDES = 12, 7, 6
_SIDE = (-1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Dress:
    """Body and clothes of a figure.

    Attributes:
        female: hips, waist, shoulders and chest of a woman.
        width: breadth of trunk and limbs over the usual one.
        belly: what the belly stands out, metres of a figure of 1.8 m.
        top: what covers the trunk; coats and dresses reach down to the thighs.
        pattern: where the second colour of the top shows.
        bottom: what covers the legs.
        hair: of the head, or what covers it.
        bag: what the figure carries.
        held: what it holds in its right hand, before its chest.
        upper, lower, hands, shoes, cover: materials; ``cover`` is that of hats and helmets.
        fists: the hands hold something.
        head: size of the head over an adult's.
    """

    female: bool = False
    width: float = 1.0
    belly: float = 0.0
    top: Literal["shirt", "tee", "jacket", "coat", "dress"] = "shirt"
    pattern: Literal["plain", "stripes", "block", "print", "vest", "raglan"] = "plain"
    bottom: Literal["trousers", "leggings", "shorts", "skirt", "long skirt"] = "trousers"
    hair: Hair = "short"
    bag: Literal["none", "rucksack", "shoulder", "hand", "shopping"] = "none"
    held: Held = "nothing"
    upper: Material = Material.CLOTH_UPPER
    lower: Material = Material.CLOTH_LOWER
    hands: Material = Material.SKIN
    shoes: Material = Material.SHOE
    cover: Material = Material.BAG
    fists: bool = False
    head: float = 1.0


def add_figure(builder: ShapeBuilder, pose: Pose, dress: Dress, size_m: float, tag: int) -> None:
    """Add a figure of a size from sole to crown."""
    figure = figure_of(dress, size_m)
    builder.add(figure.vertices(pose), figure.triangles, figure.material, tag=tag, crease_deg=75.0)


@lru_cache(maxsize=128)
def figure_of(dress: Dress, size_m: float) -> Figure:
    """A figure that any pose can be given to."""
    parts = Parts(size_m / HEIGHT_M)
    _add_trunk(parts, dress)
    for side in (0, 1):
        _add_leg(parts, dress, side)
        _add_foot(parts, dress, side)
        _add_arm(parts, dress, side)
        _add_hand(parts, dress, side)
    _add_skirt(parts, dress)
    add_head(parts, dress.hair, dress.cover, dress.head)
    _add_bag(parts, dress)
    add_held(parts, dress.held)
    return parts.figure()


def oval(half_width: float, front: float, back: float, sides: int, round_: float = 1.0) -> Array:
    """``(sides, 3)`` points around a limb, from the front to the right; < 1 is squarer."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    c, s = np.cos(angle), np.sin(angle)
    c, s = (np.sign(v) * np.abs(v) ** round_ for v in (c, s))
    ahead = np.where(c > 0, c * front, c * back)
    return np.stack([ahead, s * half_width, np.zeros(sides)], axis=-1)


def _rings(
    rows: Sequence[tuple[float, float, float, float]], sides: int, round_: float = 1.0
) -> Array:
    return np.stack([oval(wide, front, back, sides, round_) for _, wide, front, back in rows])


# Rows of the trunk: place from pelvis (0) to neck (1), half width, front, back.
_MAN = [
    (0.26, 0.150, 0.108, 0.096), (0.43, 0.157, 0.112, 0.104), (0.60, 0.169, 0.118, 0.112),
    (0.75, 0.176, 0.108, 0.112), (0.86, 0.172, 0.080, 0.098), (0.94, 0.112, 0.060, 0.080),
    (1.00, 0.064, 0.052, 0.064),
]  # fmt: skip
_WOMAN = [
    (0.26, 0.128, 0.094, 0.086), (0.43, 0.133, 0.104, 0.092), (0.60, 0.148, 0.134, 0.098),
    (0.75, 0.154, 0.106, 0.100), (0.86, 0.154, 0.074, 0.088), (0.94, 0.100, 0.054, 0.070),
    (1.00, 0.056, 0.046, 0.056),
]  # fmt: skip
_MANS_HEM = [(-0.15, 0.168, 0.116, 0.140), (0.06, 0.162, 0.112, 0.120)]
_WOMANS_HEM = [(-0.15, 0.178, 0.112, 0.146), (0.06, 0.155, 0.103, 0.117)]
_MANS_SEAT = [
    (-0.32, 0.070, 0.050, 0.060), (-0.24, 0.148, 0.086, 0.108), (-0.06, 0.160, 0.102, 0.126),
    (0.08, 0.152, 0.102, 0.108),
]  # fmt: skip
_WOMANS_SEAT = [
    (-0.32, 0.070, 0.050, 0.062), (-0.24, 0.158, 0.088, 0.114), (-0.06, 0.168, 0.098, 0.132),
    (0.08, 0.146, 0.092, 0.104),
]  # fmt: skip


def _add_trunk(parts: Parts, dress: Dress) -> None:
    rows = (_WOMANS_HEM + _WOMAN) if dress.female else (_MANS_HEM + _MAN)
    seat = _WOMANS_SEAT if dress.female else _MANS_SEAT
    loose = {"jacket": 0.014, "coat": 0.016}.get(dress.top, 0.0)
    grown = [
        (
            t,
            wide * dress.width + (loose if t < 0.95 else loose / 3),
            front * dress.width + loose + dress.belly * float(np.exp(-(((t - 0.2) / 0.3) ** 2))),
            back * dress.width + loose,
        )
        for t, wide, front, back in rows
    ]
    material = np.full((len(grown) - 1, _TRUNK_SIDES), dress.upper, np.uint8)
    _paint_pattern(material, dress)
    rings = _rings(grown, _TRUNK_SIDES, 0.86)
    parts.loft([(Chain.TRUNK, row[0]) for row in grown], rings, material, capped=False)
    seat = [
        (t, w * dress.width, f * dress.width + (dress.belly * 0.7 if t > 0 else 0.0),
         b * dress.width)
        for t, w, f, b in seat
    ]  # fmt: skip
    parts.loft(
        [(Chain.TRUNK, row[0]) for row in seat], _rings(seat, _TRUNK_SIDES, 0.9),
        dress.upper if dress.top in ("dress", "coat") else dress.lower,
    )  # fmt: skip
    # Neck: from the collar up into the head.
    size = 0.90 if dress.female else 1.0
    neck = [(0.056, 0.044, 0.056), (0.055, 0.050, 0.060), (0.055, 0.050, 0.064)]
    rings = np.stack([oval(w * size, f * size, b * size, 8) for w, f, b in neck])
    rings[2, :, 2] = -0.075 * dress.head
    parts.loft(
        [(Chain.TRUNK, 0.95), (Chain.TRUNK, 1.04), (Chain.HEAD, 0.0)], rings, Material.SKIN,
        capped=False,
    )  # fmt: skip
    if dress.top in ("jacket", "coat"):
        collar = np.stack([oval(0.082, 0.064, 0.078, 10), oval(0.074, 0.056, 0.074, 10)])
        paint = np.full((1, 10), dress.upper, np.uint8)
        anchors = [(Chain.TRUNK, 0.955), (Chain.TRUNK, 1.075)]
        parts.loft(anchors, collar[:, 1:], paint[:, 1:-1], closed=False, capped=False)


def _paint_pattern(material: NDArray[np.uint8], dress: Dress) -> None:
    """Give quads of the trunk, rows from hem to collar, the second colour."""
    accent, rows = Material.CLOTH_ACCENT, len(material)
    middle = (_TRUNK_SIDES - 1, 0)
    if dress.pattern == "stripes":
        material[::2] = accent
    elif dress.pattern == "block":
        material[rows // 2 + 1 :] = accent
    elif dress.pattern == "print":
        material[rows - 5 : rows - 3, middle] = accent
    elif dress.pattern == "vest":
        material[1:-1] = accent
        material[3] = Material.SIGN_WHITE
    if dress.top in ("jacket", "coat"):
        # An open front, with the shirt behind it.
        material[1 if dress.top == "jacket" else 5 :, middle] = accent
    if dress.top in ("tee", "dress") and dress.female:
        material[-1] = Material.SKIN


def _tube(
    parts: Parts, chain: Chain, rows: list[tuple[float, float, Material]], *, squash: float = 1.0,
    sides: int, aside: Sequence[float] = (),
) -> None:  # fmt: skip
    """A round limb whose ends are hidden: place, radius and material from there on of a ring."""
    rings = np.stack([oval(r, r * squash, r * squash, sides) for _, r, _ in rows])
    if aside:
        rings[..., 1] += np.asarray(aside)[:, None]
    material = np.array([kind for _, _, kind in rows[:-1]], np.uint8)[:, None]
    kinds = np.repeat(material, sides, axis=1)
    parts.loft([(chain, t) for t, _, _ in rows], rings, kinds, capped=False)


def _add_leg(parts: Parts, dress: Dress, side: int) -> None:
    cloth, skin = dress.lower, Material.SKIN
    w = dress.width * (1.02 if dress.female else 1.0)
    bare = dress.bottom in ("shorts", "skirt", "long skirt")
    thigh = skin if dress.bottom in ("skirt", "long skirt") else cloth
    if bare or dress.bottom == "leggings":
        kind = cloth if dress.bottom == "leggings" else skin
        hem = [(0.72, 0.078 * w, skin), (0.73, 0.058 * w, skin)] if thigh == cloth and bare else []
        rows = [
            (-0.08, 0.070 * w, thigh), (0.12, 0.084 * w, thigh), (0.5, 0.069 * w, thigh), *hem,
            (0.95, 0.051 * w, kind), (1.10, 0.048 * w, kind), (1.32, 0.054 * w, kind),
            (1.80, 0.034 * w, kind), (2.0, 0.036 * w, kind),
        ]  # fmt: skip
    else:
        # Trousers fold at the knee and above the shoe.
        rows = [
            (-0.08, 0.072 * w, cloth), (0.12, 0.090 * w, cloth), (0.5, 0.077 * w, cloth),
            (0.88, 0.063 * w, cloth), (0.99, 0.067 * w, cloth), (1.09, 0.061 * w, cloth),
            (1.40, 0.062 * w, cloth), (1.80, 0.054 * w, cloth), (1.88, 0.060 * w, cloth),
            (2.02, 0.055 * w, cloth),
        ]  # fmt: skip
    _tube(parts, LEGS[side], rows, squash=1.06, sides=_LEG_SIDES)


def _add_foot(parts: Parts, dress: Dress, side: int) -> None:
    # Place ahead of the ankle, half width, top above the sole; the sole is flat and 8.5 cm lower.
    rows = [
        (-0.072, 0.022, 0.060), (-0.050, 0.036, 0.090), (0.020, 0.041, 0.104),
        (0.110, 0.047, 0.064), (0.165, 0.041, 0.050), (0.195, 0.018, 0.036),
    ]  # fmt: skip
    rings = []
    for x, wide, top in rows:
        across = np.array([0.55, 1.0, 1.0, 0.85, -0.85, -1.0, -1.0, -0.55]) * wide
        height = np.array([1.0, 0.45, 0.24, 0.0, 0.0, 0.24, 0.45, 1.0]) * top - 0.085
        # Soles are round at both ends, on which a foot rolls.
        height = np.maximum(height, -0.085 + (0.012 if x < -0.07 else 0.023 if x > 0.19 else 0.0))
        rings.append(np.stack([np.full(8, x), across, height], axis=-1))
    material = np.full((len(rows) - 1, 8), dress.shoes, np.uint8)
    if dress.shoes == Material.SHOE:
        material[:, 2:5] = Material.SOLE
    parts.loft([(FEET[side], 0.0)] * len(rows), np.stack(rings), material)


def _add_arm(parts: Parts, dress: Dress, side: int) -> None:
    w = dress.width * (0.90 if dress.female else 1.0)
    loose = 0.006 if dress.top in ("jacket", "coat") else 0.0
    cloth, skin = dress.upper, Material.SKIN
    if dress.pattern == "vest":
        cloth = Material.CLOTH_ACCENT
    if dress.pattern == "raglan":
        cloth = Material.CLOTH_ACCENT
    lower = Material.CLOTH_ACCENT if dress.pattern == "stripes" else cloth
    if dress.top in ("tee", "dress"):
        rows = [
            (-0.15, 0.016, cloth), (-0.09, 0.040, cloth), (0.06, 0.053 * w, cloth),
            (0.52, 0.055 * w, skin), (0.53, 0.043 * w, skin), (0.93, 0.037 * w, skin),
            (1.15, 0.040 * w, skin), (1.9, 0.026 * w, skin),
        ]  # fmt: skip
    else:
        rows = [
            (-0.15, 0.016, cloth), (-0.09, 0.042, cloth), (0.06, 0.056 * w + loose, lower),
            (0.86, 0.045 * w + loose, cloth),
            (0.97, 0.048 * w + loose, lower), (1.08, 0.044 * w + loose, lower),
            (1.5, 0.041 * w + loose, cloth), (1.93, 0.036 * w + loose, cloth),
            (1.96, 0.027 * w, dress.hands),
        ]  # fmt: skip
    # Shoulders are round: what is above the joint lies nearer to the trunk.
    inward = [-_SIDE[side] * 0.2 * max(0.06 - t, 0.0) for t, _, _ in rows]
    _tube(parts, ARMS[side], rows, sides=_ARM_SIDES, aside=inward)


def _add_hand(parts: Parts, dress: Dress, side: int) -> None:
    """A hand with its thumb to the front; it hangs, or holds something."""
    arm, forearm = ARMS[side], 0.26
    size = 0.92 if dress.female else 1.0
    # Way from the wrist, half breadth, half thickness, how far it is curled to the body.
    open_ = [(-0.01, 0.027, 0.021, 0.0), (0.045, 0.041, 0.017, 0.0), (0.10, 0.042, 0.015, 0.006),
             (0.168, 0.018, 0.008, 0.030)]  # fmt: skip
    fist = [(-0.01, 0.027, 0.021, 0.0), (0.02, 0.040, 0.026, 0.0), (0.05, 0.042, 0.030, 0.004),
            (0.07, 0.030, 0.022, 0.010)]  # fmt: skip
    closed = dress.fists or (side == 1 and dress.held != "nothing")
    rows = fist if closed else open_
    rings = np.stack([oval(thin, wide, wide, 6) for _, wide, thin, _ in rows]) * size
    rings[..., 1] -= np.array([row[3] for row in rows])[:, None] * _SIDE[side] * size
    anchors = [(arm, 2.0 + row[0] * size / forearm) for row in rows]
    parts.loft(anchors, rings, dress.hands)
    if not closed:
        thumb = [(0.02, 0.022, 0.012), (0.055, 0.046, 0.011), (0.092, 0.052, 0.007)]
        rings = np.stack([oval(r, r, r, 4) + np.array([x, 0.0, 0.0]) for _, x, r in thumb]) * size
        rings[..., 1] -= 0.010 * _SIDE[side]
        parts.loft([(arm, 2.0 + d * size / forearm) for d, _, _ in thumb], rings, dress.hands)


def _add_skirt(parts: Parts, dress: Dress) -> None:
    """What hangs around both legs, down from the hips: skirts, dresses, coats."""
    w = dress.width
    if dress.bottom == "skirt":
        rows, kind = [(0.0, 0.082, 0.116), (0.35, 0.088, 0.122), (0.86, 0.100, 0.136)], dress.lower
    elif dress.bottom == "long skirt":
        rows = [(0.0, 0.086, 0.118), (0.5, 0.096, 0.130), (1.0, 0.106, 0.142), (1.55, 0.120, 0.16)]
        kind = dress.lower
    elif dress.top == "coat":
        rows, kind = [(-0.1, 0.092, 0.134), (0.3, 0.100, 0.142), (0.78, 0.110, 0.150)], dress.upper
    else:
        return
    if dress.top == "dress":
        kind = dress.upper
    # Points from the front to the right, each on the leg that moves it.
    angle = 2.0 * np.pi * np.arange(_TRUNK_SIDES) / _TRUNK_SIDES
    chains = [
        Chain.LEGS if abs(np.sin(a)) < 0.3 else LEGS[1 if np.sin(a) > 0 else 0] for a in angle
    ]
    rings, anchors = [], []
    for place, wide, deep in rows:
        outward = np.sign(np.sin(angle)) * (np.abs(np.sin(angle)) - 0.5) * 2.0 * (wide * w - 0.008)
        outward = np.where(np.abs(np.sin(angle)) < 0.3, 0.0, outward)
        ahead = np.cos(angle) * deep * w
        rings.append(np.stack([ahead, outward, np.zeros_like(angle)], axis=-1))
        anchors.append([(chain, place) for chain in chains])
    parts.loft(anchors, np.stack(rings), kind, capped=False)


def _add_bag(parts: Parts, dress: Dress) -> None:
    bag = Material.BAG
    w = dress.width
    if dress.bag == "rucksack":
        rows = [(0.12, 0.10, 0.05), (0.20, 0.138, 0.085), (0.62, 0.142, 0.085), (0.84, 0.115, 0.06),
                (0.90, 0.06, 0.03)]  # fmt: skip
        rings = np.stack([oval(wide, deep, deep, 8, 0.7) for _, wide, deep in rows])
        rings[..., 0] -= 0.185 * w
        parts.loft([(Chain.TRUNK, t) for t, _, _ in rows], rings, bag)
        pocket = np.stack([oval(0.09, 0.03, 0.035, 6, 0.7) for _ in range(2)])
        pocket[..., 0] -= 0.185 * w + 0.075
        parts.loft([(Chain.TRUNK, 0.22), (Chain.TRUNK, 0.46)], pocket, bag)
        for sign in _SIDE:
            strap = [(0.30, 0.112), (0.60, 0.138), (0.78, 0.118), (0.92, 0.075), (0.97, 0.0),
                     (0.92, -0.10)]  # fmt: skip
            across = np.array([0.088, 0.128]) * sign * w
            rings = np.array([[[x * w + 0.012, y, 0.0] for y in across] for _, x in strap])
            anchors = [(Chain.TRUNK, t) for t, _ in strap]
            parts.loft(anchors, rings, bag, closed=False, capped=False)
    elif dress.bag == "shoulder":
        hip = (Chain.TRUNK, 0.02)
        side = (0.165 if dress.female else 0.155) * w
        parts.box(hip, (-0.13, side, -0.13), (0.10, side + 0.07, 0.10), bag)
        sling = [(0.06, 0.05, side + 0.02), (0.45, 0.118, 0.075), (0.75, 0.118, -0.05),
                 (0.94, 0.03, -0.108), (0.75, -0.118, -0.06), (0.40, -0.112, 0.07),
                 (0.06, -0.06, side + 0.02)]  # fmt: skip
        rings = np.array(
            [[[x * w * 1.04 + np.sign(x) * 0.01, y * w, d] for d in (-0.02, 0.02)]
             for _, x, y in sling]
        )  # fmt: skip
        anchors = [(Chain.TRUNK, t) for t, _, _ in sling]
        parts.loft(anchors, rings, bag, closed=False, capped=False)
    elif dress.bag == "hand":
        _add_hanging_bag(parts, Chain.CARRIED, (0.15, 0.045, 0.23), bag)
    elif dress.bag == "shopping":
        _add_hanging_bag(parts, Chain.CARRIED, (0.10, 0.065, 0.34), bag)
        _add_hanging_bag(parts, Chain.HELD, (0.09, 0.055, 0.28), Material.SIGN_WHITE)


def _add_hanging_bag(
    parts: Parts, chain: Chain, size: tuple[float, float, float], material: Material
) -> None:
    """A bag below a hand: half length, half width and height."""
    hand = (chain, 0.0)
    long, wide, tall = size
    parts.box(hand, (-long, -wide, -0.13 - tall), (long, wide, -0.13), material)
    for end in (-0.07, 0.07):
        handle = [[(end, y, -0.14), (0.3 * end, y, -0.06)] for y in (-0.012, 0.012)]
        parts.loft([hand] * 2, handle, material, closed=False, capped=False)
