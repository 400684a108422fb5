"""Trees: a trunk that forks into limbs, and sprays of leaves around the ends of the limbs.

A spray is one triangle of a leaf material, on which only the leaves are there (see
``carstage_sim.render.leaves``): the sky shows between them. Normals of a spray point away from its
clump and from the crown's middle, so that each clump has a light and a dark side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.solids import tube
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_TAG = CityObjectLabel.VEGETATION
GOLDEN_RAD = 2.399963
"""Turn from one clump to the next, so that no two are above each other."""
STREET_TRUNK_M = 4.3
PRUNED_M = 4.0
"""Of trees beside roads: vehicles pass below them, and drivers see under them."""


class Form(Enum):
    """How a species grows."""

    ROUND = "round"
    COLUMN = "column"
    FIR = "fir"
    PINE = "pine"


@dataclass(frozen=True, slots=True)
class TreeKind:
    """A species.

    Attributes:
        height_m: fewest and most.
        trunk_m: height of the clear trunk.
        crown: half width and half height of the crown per metre of tree above the trunk.
        clumps: groups of sprays, each at the end of a limb; whorls of boughs of a fir.
        sprays: triangles with leaves.
        spray_m: length of a spray.
        leaves: what the sprays are made of; inside the crown are ``shaded`` ones.
        form: how it grows.
        hang: how far the sprays' tips hang down, 0-1.
        bark: of trunk and limbs.
        thick: thickness of the trunk; 1 is usual for the height.
        pruned_m: height below which no leaf hangs.
    """

    name: str
    height_m: tuple[float, float]
    trunk_m: float
    crown: tuple[float, float]
    clumps: int
    sprays: int
    spray_m: float
    leaves: Material = Material.LEAVES
    shaded: Material = Material.LEAVES_DARK
    form: Form = Form.ROUND
    hang: float = 0.3
    bark: Material = Material.BARK
    thick: float = 1.0
    pruned_m: float = 0.0


TREE_KINDS: tuple[TreeKind, ...] = (
    TreeKind("Linden", (7.5, 10.5), 2.6, (0.40, 0.5), 13, 430, 1.0),
    TreeKind("Plane", (8.0, 11.0), 3.0, (0.48, 0.46), 13, 430, 1.15, Material.LEAVES_DARK),
    TreeKind(
        "Columnar", (7.0, 10.0), 1.8, (0.17, 0.5), 11, 400, 0.8, Material.LEAVES_SMALL,
        form=Form.COLUMN, hang=-0.9,
    ),
    TreeKind("Cherry", (4.5, 6.0), 2.0, (0.55, 0.48), 11, 400, 0.8, Material.LEAVES_LIGHT),
    TreeKind(
        "Spruce", (9.0, 14.0), 1.4, (0.22, 0.5), 15, 600, 1.0, Material.NEEDLES, Material.NEEDLES,
        form=Form.FIR, thick=0.75,
    ),
    TreeKind(
        "Birch", (7.0, 10.0), 2.4, (0.30, 0.5), 13, 400, 0.85, Material.LEAVES_SMALL,
        Material.LEAVES_SMALL, hang=1.0, bark=Material.BARK_PALE, thick=0.75,
    ),
    TreeKind("Hornbeam", (4.2, 5.2), 1.9, (0.32, 0.5), 8, 300, 0.62, thick=0.8),
    TreeKind(
        "Pine", (9.0, 12.0), 4.2, (0.42, 0.4), 10, 420, 0.95, Material.NEEDLES, Material.NEEDLES,
        form=Form.PINE, hang=-0.4,
    ),
)  # fmt: skip

AUTUMN: dict[Material, Material] = {
    Material.LEAVES: Material.LEAVES_YELLOW,
    Material.LEAVES_LIGHT: Material.LEAVES_RED,
    Material.LEAVES_SMALL: Material.LEAVES_YELLOW,
    Material.LEAVES_DARK: Material.LEAVES_RED,
}
"""What the leaves of summer become."""


@dataclass(frozen=True, slots=True)
class _Sprays:
    """Places of sprays with where they face, where their tips point, and how deep they are.

    Attributes:
        places, facing, along: ``(N, 3)``.
        deep: ``(N,)`` bool, inside the crown.
    """

    places: NDArray[np.float64]
    facing: NDArray[np.float64]
    along: NDArray[np.float64]
    deep: NDArray[np.bool_]


def street_form(kind: TreeKind) -> TreeKind:
    """The species as it is grown beside a road: a higher trunk, pruned below its crown."""
    low, high = kind.height_m
    return replace(
        kind,
        height_m=(low + STREET_TRUNK_M - kind.trunk_m, high + STREET_TRUNK_M - kind.trunk_m),
        trunk_m=STREET_TRUNK_M,
        pruned_m=PRUNED_M,
        thick=0.72 * kind.thick,
    )


def tree_mesh(
    kind: TreeKind, height_m: float, rng: np.random.Generator, *, autumn: bool = False
) -> TriangleMesh:
    """A tree that stands on the origin; less than 700 triangles, all tagged as vegetation.

    Args:
        kind: the species.
        height_m: of its top.
        rng: draws the limbs and the leaves.
        autumn: its leaves have turned.
    """
    crown_m = height_m - kind.trunk_m
    middle = np.array([0.0, 0.0, kind.trunk_m + crown_m / 2])
    half = np.array([kind.crown[0], kind.crown[0], kind.crown[1]]) * crown_m
    parts = [_trunk(kind, height_m, rng)]
    if kind.form is Form.FIR:
        sprays = _boughs(kind, height_m, rng)
    else:
        clumps = _clumps(kind, middle, half, rng)
        parts += _limbs(kind, height_m, clumps, rng)
        sprays = _clump_sprays(kind, middle, half, clumps, rng)
    parts.append(_spray_mesh(kind, sprays, rng, autumn=autumn))
    return merge_meshes(parts)


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """``(N, 3)`` vectors of length 1."""
    length = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    scaled: NDArray[np.float64] = vectors / np.maximum(length, 1e-9)
    return scaled


def _trunk(kind: TreeKind, height_m: float, rng: np.random.Generator) -> TriangleMesh:
    crown_m = height_m - kind.trunk_m
    share = {Form.FIR: 0.94, Form.COLUMN: 0.8, Form.PINE: 0.75, Form.ROUND: 0.45}[kind.form]
    top = kind.trunk_m + share * crown_m
    lean = rng.uniform(-0.12, 0.12, 2)
    thick = (0.018 * height_m + 0.03) * kind.thick
    path = [(0, 0, 0), (0, 0, 0.25), (*(0.5 * lean), 0.5 * top), (*lean, top)]
    radii = np.array([1.5, 1.05, 0.8, 0.3]) * thick
    return tube(path, radii, kind.bark, _TAG, sides=8, capped=False)


def _clumps(
    kind: TreeKind,
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    rng: np.random.Generator,
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Middles and half sizes ``(3,)`` of the clumps, spread over the crown."""
    start = rng.uniform(0.0, 2 * np.pi)
    # A pine's clumps are flat and near the top; a column's follow its axis.
    lowest, inward, flat = {
        Form.ROUND: (-0.72, 0.62, 0.85),
        Form.COLUMN: (-0.8, 0.4, 1.5),
        Form.PINE: (-0.35, 0.62, 0.5),
        Form.FIR: (0.0, 0.0, 1.0),
    }[kind.form]
    size = float(half[0]) * (0.85 if kind.form is Form.COLUMN else 0.47)
    result = []
    for i in range(kind.clumps):
        level = lowest + (0.8 - lowest) * (i + 0.5 * float(rng.random())) / (kind.clumps - 0.5)
        ring = np.sqrt(max(0.0, 1.0 - level * level)) * inward * float(rng.uniform(0.8, 1.15))
        angle = start + i * GOLDEN_RAD + float(rng.uniform(-0.3, 0.3))
        place = middle + half * np.array([np.cos(angle) * ring, np.sin(angle) * ring, level * 0.86])
        reach = size * float(rng.uniform(0.82, 1.18)) * (1.0 - 0.25 * max(level, 0.0))
        result.append((place, reach * np.array([1.0, 1.0, flat])))
    return result


def _limbs(
    kind: TreeKind,
    height_m: float,
    clumps: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    rng: np.random.Generator,
) -> list[TriangleMesh]:
    """A limb from the trunk to each clump; the higher ones leave it higher."""
    crown_m = height_m - kind.trunk_m
    thick = (0.018 * height_m + 0.03) * kind.thick
    parts = []
    for place, _ in clumps:
        rise = float(place[2]) - kind.trunk_m
        leaves_at = kind.trunk_m * 0.92 + min(0.45 * rise, 0.36 * crown_m)
        if kind.form is not Form.ROUND:
            leaves_at = max(leaves_at, float(place[2]) - (0.9 if kind.form is Form.PINE else 1.4))
        fork = np.array([0.0, 0.0, leaves_at])
        bend = np.array([*rng.uniform(-0.15, 0.15, 2), 0.1 if rise > 0.5 * crown_m else 0.3])
        knee = fork + (place - fork) * 0.5 + bend
        radii = np.array([0.42, 0.26, 0.1]) * thick
        parts.append(tube([fork, knee, place], radii, kind.bark, _TAG, sides=4, capped=False))
    return parts


def _clump_sprays(
    kind: TreeKind,
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    clumps: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    rng: np.random.Generator,
) -> _Sprays:
    """Sprays around the middles of the clumps, most of them near the clumps' skins."""
    centers = np.array([center for center, _ in clumps])
    reach = np.array([size for _, size in clumps])
    share = np.cumsum(reach[:, 0] ** 2)
    owner = np.searchsorted(share / share[-1], rng.random(kind.sprays)).clip(0, len(clumps) - 1)
    outward = unit(rng.normal(size=(kind.sprays, 3)))
    depth = 0.35 + 0.72 * np.sqrt(rng.random(kind.sprays))
    places = centers[owner] + outward * reach[owner] * depth[:, None]
    from_middle = (places - middle) / half
    facing = 0.8 * outward + 0.9 * from_middle + np.array([0.0, 0.0, 0.35])
    facing = unit(facing + rng.normal(scale=0.22, size=facing.shape))
    along = rng.normal(size=facing.shape) + 0.7 * outward - np.array([0.0, 0.0, 1.1 * kind.hang])
    deep = (from_middle**2).sum(axis=1) < 0.34
    return _Sprays(places, facing, unit(along), deep)


def _boughs(kind: TreeKind, height_m: float, rng: np.random.Generator) -> _Sprays:
    """Whorls of drooping boughs, each of some sprays behind each other, longer below."""
    crown_m = height_m - kind.trunk_m
    count = kind.sprays
    # The lower part of a cone has most of its skin.
    level = 1.0 - np.sqrt(rng.random(count))
    whorl = np.minimum(np.floor(level * kind.clumps), kind.clumps - 1)
    boughs = 9 - np.floor(4 * whorl / kind.clumps)
    turn = np.floor(rng.random(count) * boughs) / boughs + whorl * 0.37
    angle = turn * 2 * np.pi + rng.normal(scale=0.09, size=count)
    level = (whorl + rng.normal(scale=0.12, size=count)).clip(0.0) / kind.clumps
    longest = kind.crown[0] * crown_m * (1.0 - level) + 0.12
    part = 0.12 + 0.88 * np.sqrt(rng.random(count))
    away = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    places = away * (longest * part)[:, None]
    # Boughs sink towards their ends and rise again at the tips.
    sag = 0.26 * longest * part
    places[:, 2] = kind.trunk_m + 0.75 + level * (crown_m - 0.9) - sag
    aside = rng.normal(scale=0.5, size=(count, 3)) * np.array([1.0, 1.0, 0.35])
    along = unit(0.8 * away + aside - np.array([0.0, 0.0, 0.8]))
    facing = unit(away * 0.8 + np.array([0.0, 0.0, 0.75]) + rng.normal(scale=0.2, size=(count, 3)))
    return _Sprays(places, facing, along, part < 0.45)


def spray_triangles(
    places: NDArray[np.float64],
    along: NDArray[np.float64],
    facing: NDArray[np.float64],
    size_m: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """``(N, 3, 3)`` corners of pointed triangles, their tips first.

    Args:
        places: ``(N, 3)`` about the middles, metres.
        along, facing: ``(N, 3)`` unit vectors: towards the tip, and about across the triangle.
        size_m: ``(N,)`` lengths.
        rng: turns them about ``along``.
    """
    across = unit(np.cross(along, facing + rng.normal(scale=0.55, size=places.shape)))
    size = size_m[:, None]
    foot = places - along * size * 0.4
    aside = across * size * 0.5
    return np.stack([places + along * size * 0.6, foot + aside, foot - aside], axis=1)


def _spray_mesh(
    kind: TreeKind, sprays: _Sprays, rng: np.random.Generator, *, autumn: bool
) -> TriangleMesh:
    """A pointed triangle for each spray, its tip first."""
    count = len(sprays.places)
    size = kind.spray_m * rng.uniform(0.75, 1.25, count)
    if kind.form is Form.FIR:
        away = np.sqrt((sprays.places[:, :2] ** 2).sum(axis=1))
        size = np.minimum(size * (0.55 + 0.45 * away), 1.3 * kind.spray_m)
    corners = spray_triangles(sprays.places, sprays.along, sprays.facing, size, rng)
    leaves, shaded = kind.leaves, kind.shaded
    if autumn:
        leaves = AUTUMN.get(leaves, leaves)
        shaded = AUTUMN.get(shaded, shaded)
    material = np.where(sprays.deep, int(shaded), int(leaves))
    kept = corners[..., 2].min(axis=1) >= kind.pruned_m
    return build_mesh(
        corners[kept].reshape(-1, 3),
        np.arange(3 * int(kept.sum())).reshape(-1, 3),
        material[kept],
        _TAG,
        normals=np.repeat(sprays.facing[kept, None, :], 3, axis=1),
    )
