"""Street furniture: traffic lights, lamps, signs, benches, bins, bollards.

Every mesh stands on the origin of its own frame (CARLA axes, metres).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from carstage_sim.content.solids import box, disc, quad_mesh, tube
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_LIGHT, _POLE = CityObjectLabel.TRAFFIC_LIGHT, CityObjectLabel.POLES
_SIGN, _STATIC = CityObjectLabel.TRAFFIC_SIGNS, CityObjectLabel.STATIC
_LENSES = (Material.LIGHT_RED, Material.LIGHT_YELLOW, Material.LIGHT_GREEN)
_LENS_RADIUS_M = 0.145
"""Of signals of the size 300 mm (EN 12368)."""
_LENS_SPACING_M = 0.345
_SECOND_HEAD_HEIGHT_M = 3.0
_ARM_ABOVE_HEAD_M, _MAST_ABOVE_ARM_M = 0.35, 0.25
_PLATE_HEIGHT_M = 2.35
MAST_RADIUS_M = 0.19
"""Of the foot of a traffic light."""
_BELOW_KERB_M = 0.2
"""How far that foot reaches below the ground under it: beside it a kerb may end."""


def traffic_light_mesh(head: tuple[float, float, float, float]) -> TriangleMesh:
    """A mast with an arm: one head at the arm's end, a smaller one on the mast.

    Args:
        head: x, y, z (m) of the middle of the main head in the actor's frame, whose origin is the
            foot of the mast, and the yaw (deg) that the lenses look along.

    Returns:
        Mast and arm tagged as poles, heads as traffic lights; the lenses carry the materials
        ``LIGHT_RED``, ``LIGHT_YELLOW`` and ``LIGHT_GREEN``.
    """
    x, y, z, yaw_deg = head
    reach = math.hypot(x, y)
    along = np.array([x, y]) / reach if reach > 0 else np.zeros(2)
    arm_height = z + _ARM_ABOVE_HEAD_M
    metal = Material.METAL
    at_arm, at_mast = light_head_middles(head)
    parts = [
        tube([(0, 0, -_BELOW_KERB_M), (0, 0, 0.35)], MAST_RADIUS_M, metal, _POLE, sides=10),
        tube(
            [(0, 0, 0.35), (0, 0, light_mast_height_m(head))], [0.11, 0.075], metal, _POLE, sides=10
        ),
        _head(at_arm, yaw_deg),
    ]
    if reach > 0:
        end = along * (reach + 0.25)
        rise = (along[0] * 0.3, along[1] * 0.3, arm_height)
        parts.append(
            tube(
                [(0, 0, arm_height - 0.05), rise, (end[0], end[1], arm_height + 0.1)],
                [0.07, 0.065, 0.045],
                metal,
                _POLE,
            )
        )
    parts.append(_head(at_mast, yaw_deg))
    parts.append(
        box(
            (at_mast[0] / 2, at_mast[1] / 2, _SECOND_HEAD_HEIGHT_M),
            (0.1, 0.03, 0.04),
            metal,
            _POLE,
            yaw_deg=yaw_deg,
        )
    )
    return merge_meshes(parts)


def light_mast_height_m(head: tuple[float, float, float, float]) -> float:
    """Height of the mast's top above its foot.

    Args:
        head: as :func:`traffic_light_mesh` has it.
    """
    return head[2] + _ARM_ABOVE_HEAD_M + _MAST_ABOVE_ARM_M


def light_head_middles(head: tuple[float, float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Middles ``(3,)`` of the housings at the arm's end and on the mast, in the actor's frame.

    Args:
        head: as :func:`traffic_light_mesh` has it.
    """
    x, y, z, yaw_deg = head
    yaw = math.radians(yaw_deg)
    beside = (0.22 * math.cos(yaw), 0.22 * math.sin(yaw), _SECOND_HEAD_HEIGHT_M)
    return np.array([x, y, z]), np.array(beside)


@cache
def light_head_bounds() -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner ``(3,)`` of a head around its middle, looking along +x."""
    low, high = _head(np.zeros(3), 0.0).bounds.astype(np.float64)
    return low, high


def _head(middle: np.ndarray, yaw_deg: float) -> TriangleMesh:
    """Three housings with hooded lenses, red on top, behind one front and its backplate."""
    dark = Material.PLASTIC_DARK
    forward = np.array([math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg)), 0.0])
    side = np.array([-forward[1], forward[0], 0.0])
    up = np.array([0.0, 0.0, 1.0])
    parts = [
        box(middle + forward * 0.06, (0.05, 0.175, 0.552), dark, _LIGHT, yaw_deg=yaw_deg),
        # The backplate makes the lenses stand out against the sky.
        box(middle + forward * 0.03, (0.01, 0.28, 0.65), dark, _LIGHT, yaw_deg=yaw_deg),
    ]
    for lens, shift in zip(_LENSES, (1, 0, -1), strict=True):
        center = middle + up * (shift * _LENS_SPACING_M) + forward * 0.115
        parts.append(disc(center, forward, _LENS_RADIUS_M, lens, _LIGHT, sides=14))
        angle = np.radians(np.linspace(-10.0, 190.0, 9))
        rim = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
        near = center + 0.16 * rim
        far = near + forward * 0.20
        hood = np.stack([near[:-1], near[1:], far[1:], far[:-1]], axis=1)
        parts.append(quad_mesh(hood, dark, _LIGHT))
        parts.append(_housing(middle + up * (shift * _LENS_SPACING_M), forward, side))
    return merge_meshes(parts)


def _housing(middle: np.ndarray, forward: np.ndarray, side: np.ndarray) -> TriangleMesh:
    """The round back of one lens's housing; between two there is a gap."""
    turn = np.radians(np.linspace(0.0, 180.0, 9))
    arc = middle + 0.165 * np.cos(turn)[:, None] * side
    arc = arc + (0.02 - 0.15 * np.sin(turn))[:, None] * forward
    up = np.array([0.0, 0.0, 0.155])
    low, high = arc - up, arc + up
    back = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)
    caps = [
        np.stack([np.broadcast_to(end[0], end[1:].shape), end[:-1], end[1:], end[1:]], axis=1)
        for end in (low[::-1], high)
    ]
    return quad_mesh(np.concatenate([back, *caps]), Material.PLASTIC_DARK, _LIGHT)


def street_lamp_mesh(height_m: float = 7.5, reach_m: float = 1.6) -> TriangleMesh:
    """A lamp whose arm reaches along +x, over the road."""
    path = [(0, 0, 0.3), (0, 0, height_m - 0.5), (0.2, 0, height_m), (reach_m, 0, height_m + 0.15)]
    return merge_meshes(
        [
            tube([(0, 0, 0), (0, 0, 0.3)], 0.15, Material.METAL, _POLE),
            tube(path, [0.085, 0.06, 0.05, 0.04], Material.METAL, _POLE),
            box((reach_m, 0, height_m + 0.17), (0.38, 0.14, 0.06), Material.METAL, _POLE),
            box((reach_m, 0, height_m + 0.095), (0.3, 0.1, 0.015), Material.STREET_LAMP, _POLE),
        ]
    )


def speed_sign_mesh(limit_kmh: int) -> TriangleMesh:
    """A round sign with a red rim and the limit in figures; it looks along +x."""
    middle, face = np.array([0.05, 0.0, 2.35]), np.array([1.0, 0.0, 0.0])
    parts = [
        tube([(0, 0, 0), (0, 0, 2.7)], 0.035, Material.METAL, _POLE, sides=6),
        disc(middle, -face, 0.33, Material.METAL, _SIGN, sides=20),
        disc(middle + face * 0.004, face, 0.33, Material.SIGN_RED, _SIGN, sides=20),
        disc(middle + face * 0.012, face, 0.25, Material.SIGN_WHITE, _SIGN, sides=20),
    ]
    figures = str(limit_kmh)
    for place, figure in enumerate(figures):
        # Seen from the front, +y is to the left.
        left = 0.08 * (len(figures) - 1) - 0.16 * place
        parts.append(_figure(figure, middle + np.array([0.02, left, 0.0])))
    return merge_meshes(parts)


def stop_sign_mesh() -> TriangleMesh:
    """A red octagon with a white rim that says STOP; it looks along +x."""
    angle = np.radians(22.5 + 45.0 * np.arange(8))
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    parts = [
        tube([(0, 0, 0), (0, 0, 2.7)], 0.035, Material.METAL, _POLE, sides=6),
        _plate(0.40 * rim, 0.046, Material.METAL, back=True),
        _plate(0.40 * rim, 0.05, Material.SIGN_WHITE),
        _plate(0.37 * rim, 0.056, Material.SIGN_RED),
    ]
    for place, letter in enumerate("STOP"):
        middle = np.array([0.062, 0.24 - 0.16 * place, _PLATE_HEIGHT_M])
        parts.append(_figure(letter, middle, Material.SIGN_WHITE))
    return merge_meshes(parts)


def yield_sign_mesh() -> TriangleMesh:
    """A white triangle with a red rim, tip down; it looks along +x."""
    angle = np.radians(-90.0 + 120.0 * np.arange(3))
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return merge_meshes(
        [
            tube([(0, 0, 0), (0, 0, 2.7)], 0.035, Material.METAL, _POLE, sides=6),
            _plate(0.52 * rim, 0.046, Material.METAL, back=True),
            _plate(0.52 * rim, 0.05, Material.SIGN_RED),
            _plate(0.32 * rim, 0.056, Material.SIGN_WHITE),
        ]
    )


def _plate(rim: np.ndarray, x: float, material: Material, *, back: bool = False) -> TriangleMesh:
    """A convex plate across x; ``rim`` is (N, 2) left and up of its middle."""
    points = np.stack([np.full(len(rim), x), rim[:, 0], _PLATE_HEIGHT_M + rim[:, 1]], axis=1)
    ring = np.arange(1, len(rim) - 1)
    fan = np.stack([np.zeros_like(ring), ring, ring + 1], axis=1)
    face = np.array([-1.0 if back else 1.0, 0.0, 0.0])
    normals = np.broadcast_to(face, (*fan.shape, 3))
    return build_mesh(points, fan, material, _SIGN, normals=normals)


_SEGMENTS = {
    "0": "abcdef", "1": "bc", "2": "abged", "3": "abgcd", "4": "fgbc", "5": "afgcd", "6": "afgedc",
    "7": "abc", "8": "abcdefg", "9": "abcfgd", "S": "afgcd", "T": "am", "O": "abcdef", "P": "abefg",
}  # fmt: skip
_SEGMENT_BOX = {
    "a": (0.0, 1.0, True), "b": (-1.0, 0.5, False), "c": (-1.0, -0.5, False),
    "d": (0.0, -1.0, True), "e": (1.0, -0.5, False), "f": (1.0, 0.5, False), "g": (0.0, 0.0, True),
    "m": (0.0, 0.0, False),
}  # fmt: skip
"""Place (to the left, up) in half widths and half heights of a figure, and whether it lies."""


def _figure(
    figure: str, middle: np.ndarray, material: Material = Material.PLASTIC_DARK
) -> TriangleMesh:
    half_width, half_height, stroke = 0.045, 0.1, 0.014
    quads = []
    for name in _SEGMENTS[figure]:
        left, up, lies = _SEGMENT_BOX[name]
        y, z = left * half_width, up * half_height
        dy = half_width + stroke if lies else stroke
        dz = stroke if lies else half_height / 2 + stroke
        if name == "m":
            dz = half_height + stroke
        quads.append([(0, y - dy, z - dz), (0, y + dy, z - dz), (0, y + dy, z + dz),
                      (0, y - dy, z + dz)])  # fmt: skip
    return quad_mesh(np.array(quads) + middle, material, _SIGN)


def bench_mesh() -> TriangleMesh:
    """A bench that looks along +x; its legs reach into the ground, which may slope."""
    wood, metal = Material.WOOD, Material.METAL
    slats = [box((x, 0, 0.45), (0.05, 0.85, 0.02), wood, _STATIC) for x in (-0.16, -0.03, 0.1)]
    back = [box((-0.25, 0, z), (0.02, 0.85, 0.05), wood, _STATIC) for z in (0.62, 0.78)]
    legs = [box((-0.05, y, 0.18), (0.2, 0.03, 0.26), metal, _STATIC) for y in (-0.6, 0.6)]
    posts = [box((-0.27, y, 0.6), (0.02, 0.03, 0.25), metal, _STATIC) for y in (-0.6, 0.6)]
    return merge_meshes([*slats, *back, *legs, *posts])


def bin_mesh() -> TriangleMesh:
    """A litter bin."""
    return merge_meshes(
        [
            tube([(0, 0, 0.0), (0, 0, 0.9)], [0.22, 0.26], Material.PLASTIC_DARK, _STATIC),
            tube([(0, 0, 0.9), (0, 0, 1.0)], [0.28, 0.2], Material.METAL, _STATIC),
        ]
    )


def hydrant_mesh() -> TriangleMesh:
    """A fire hydrant."""
    red = Material.SIGN_RED
    return merge_meshes(
        [
            tube([(0, 0, 0), (0, 0, 0.55), (0, 0, 0.7)], [0.12, 0.11, 0.03], red, _STATIC),
            tube([(0, -0.2, 0.45), (0, 0.2, 0.45)], 0.055, red, _STATIC, sides=6),
        ]
    )


def bus_shelter_mesh() -> TriangleMesh:
    """A glazed waiting shelter, open along +x; its posts reach into the ground."""
    metal, glass = Material.METAL, Material.GLASS
    posts = [
        tube([(x, y, -0.09), (x, y, 2.4)], 0.04, metal, _STATIC, sides=6)
        for x, y in ((-0.6, -1.8), (-0.6, 1.8), (0.5, -1.8), (0.5, 1.8))
    ]
    return merge_meshes(
        [
            *posts,
            box((-0.05, 0, 2.46), (0.85, 2.1, 0.06), metal, _STATIC),
            box((-0.6, 0, 1.25), (0.012, 1.75, 0.95), glass, _STATIC),
            box((-0.05, 1.8, 1.25), (0.5, 0.012, 0.95), Material.SIGN_WHITE, _STATIC),
            box((-0.35, 0, 0.45), (0.18, 1.4, 0.03), Material.WOOD, _STATIC),
            box((-0.35, 0, 0.165), (0.05, 1.2, 0.255), metal, _STATIC),
        ]
    )
