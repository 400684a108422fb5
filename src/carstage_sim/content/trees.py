"""Trees: a trunk with branches, a dense core, and many leaf clusters around it.

Crowns are made of small leaf plates whose normals point away from the crown's middle: the
silhouette is ragged like a tree's, and the shading is soft like a tree's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.solids import tube
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_TAG = CityObjectLabel.VEGETATION


@dataclass(frozen=True, slots=True)
class TreeKind:
    """A species.

    Attributes:
        height_m: fewest and most.
        trunk_m: height of the clear trunk.
        crown: half width and half height of the crown per metre of tree above the trunk.
        lobes: balls that the crown is made of.
        leaves: leaf plates per tree, one triangle each.
        leaf_m: length of a plate.
        cone: conifers: the crown narrows to the top.
    """

    name: str
    height_m: tuple[float, float]
    trunk_m: float
    crown: tuple[float, float]
    lobes: int
    leaves: int
    leaf_m: float
    cone: bool = False


TREE_KINDS: tuple[TreeKind, ...] = (
    TreeKind("Linden", (7.5, 10.5), 2.6, (0.40, 0.5), 5, 300, 0.64),
    TreeKind("Plane", (8.0, 11.0), 3.0, (0.48, 0.46), 6, 310, 0.68),
    TreeKind("Columnar", (7.0, 10.0), 1.8, (0.2, 0.5), 4, 240, 0.52),
    TreeKind("Cherry", (4.5, 6.0), 2.0, (0.55, 0.48), 5, 250, 0.48),
    TreeKind("Spruce", (9.0, 14.0), 1.4, (0.24, 0.5), 1, 420, 0.9, cone=True),
)


def tree_mesh(kind: TreeKind, height_m: float, rng: np.random.Generator) -> TriangleMesh:
    """A tree that stands on the origin; about 550 triangles, all tagged as vegetation."""
    crown_m = height_m - kind.trunk_m
    middle = np.array([0.0, 0.0, kind.trunk_m + crown_m / 2])
    half = np.array([kind.crown[0], kind.crown[0], kind.crown[1]]) * crown_m
    parts = [_trunk(kind, height_m, rng)]
    if kind.cone:
        places, outward = _cone_places(kind, height_m, rng)
        parts.append(_cone_core(kind, height_m))
    else:
        lobes = _lobes(kind, middle, half, rng)
        parts += [_ball(center, radius * 0.78, rng) for center, radius in lobes]
        parts += _branches(kind, lobes)
        places, outward = _ball_places(kind, lobes, rng)
    parts.append(_leaves(places, outward, middle, kind.leaf_m, rng, droop=kind.cone))
    return merge_meshes(parts)


def _trunk(kind: TreeKind, height_m: float, rng: np.random.Generator) -> TriangleMesh:
    top = height_m * 0.92 if kind.cone else kind.trunk_m + 0.25 * (height_m - kind.trunk_m)
    lean = rng.uniform(-0.12, 0.12, 2)
    thick = 0.018 * height_m + 0.03
    path = [(0, 0, 0), (0, 0, 0.25), (*(0.5 * lean), 0.5 * top), (*lean, top)]
    radii = np.array([1.5, 1.05, 0.85, 0.5]) * thick
    return tube(path, radii, Material.BARK, _TAG, sides=8, capped=False)


def _lobes(
    kind: TreeKind,
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    rng: np.random.Generator,
) -> list[tuple[NDArray[np.float64], float]]:
    """Balls spread evenly around the crown's middle, one of them in it."""
    result = [(middle, float(half.min()) * 0.78)]
    start = rng.uniform(0.0, 2 * np.pi)
    for i in range(1, kind.lobes):
        angle = start + i * 2.4  # golden angle: no two lobes above each other
        level = -0.55 + 1.15 * (i - 0.5) / (kind.lobes - 1)
        ring = np.sqrt(max(0.0, 1.0 - level * level)) * 0.55
        center = middle + half * np.array([np.cos(angle) * ring, np.sin(angle) * ring, level])
        result.append((center, float(half.min()) * float(rng.uniform(0.46, 0.62))))
    return result


def _ball(center: NDArray[np.float64], radius_m: float, rng: np.random.Generator) -> TriangleMesh:
    """A dented ball of 36 triangles, each lit as if it were leaves: the inside of a crown."""
    rings, sides = 3, 6
    polar = np.linspace(0.0, np.pi, rings + 2)[1:-1]
    around = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    body = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around)[None],
            np.sin(polar)[:, None] * np.sin(around)[None],
            np.broadcast_to(np.cos(polar)[:, None], (rings, sides)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    unit = np.concatenate([[(0.0, 0.0, 1.0)], body, [(0.0, 0.0, -1.0)]])
    triangles = []
    last = len(unit) - 1
    for k in range(sides):
        n = (k + 1) % sides
        triangles.append((0, 1 + k, 1 + n))
        triangles.append((last, last - sides + n, last - sides + k))
        for ring in range(rings - 1):
            a, b = 1 + ring * sides, 1 + (ring + 1) * sides
            triangles += [(a + k, b + k, b + n), (a + k, b + n, a + n)]
    index = np.array(triangles)
    dents = rng.uniform(0.8, 1.15, (len(unit), 1))
    normals = unit[index].mean(axis=1) + rng.normal(scale=0.45, size=(len(index), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return build_mesh(
        center + unit * dents * radius_m,
        index,
        Material.FOLIAGE,
        _TAG,
        normals=np.repeat(normals[:, None, :], 3, axis=1),
    )


def _branches(kind: TreeKind, lobes: list[tuple[NDArray[np.float64], float]]) -> list[TriangleMesh]:
    fork = np.array([0.0, 0.0, kind.trunk_m * 0.9])
    parts = []
    for center, _ in lobes[1:]:
        knee = fork + (center - fork) * 0.5 + np.array([0.0, 0.0, 0.15])
        parts.append(
            tube(
                [fork, knee, center], [0.09, 0.06, 0.03], Material.BARK, _TAG, sides=4, capped=False
            )
        )
    return parts


def _ball_places(
    kind: TreeKind, lobes: list[tuple[NDArray[np.float64], float]], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places on the lobes' skins, more on larger ones, none deep inside another lobe."""
    centers = np.array([center for center, _ in lobes])
    radii = np.array([radius for _, radius in lobes])
    share = radii**2 / (radii**2).sum()
    owner = rng.choice(len(lobes), size=2 * kind.leaves, p=share)
    outward = rng.normal(size=(len(owner), 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    places = (
        centers[owner] + outward * (radii[owner] * rng.uniform(0.78, 1.06, len(owner)))[:, None]
    )
    gaps = np.linalg.norm(places[:, None] - centers[None], axis=2) / radii[None]
    gaps[np.arange(len(owner)), owner] = 1.0
    shown = (gaps > 0.75).all(axis=1)
    return places[shown][: kind.leaves], outward[shown][: kind.leaves]


def _cone_places(
    kind: TreeKind, height_m: float, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    crown_m = height_m - kind.trunk_m
    # Tiers of branches, denser below, where the cone is wide.
    level = 1.0 - np.sqrt(rng.uniform(0.0, 1.0, kind.leaves))
    level = np.round(level * 14) / 14 + rng.uniform(-0.015, 0.015, kind.leaves)
    angle = rng.uniform(0.0, 2 * np.pi, kind.leaves)
    reach = kind.crown[0] * crown_m * (1.0 - level) * rng.uniform(0.55, 1.05, kind.leaves)
    outward = np.stack([np.cos(angle), np.sin(angle), np.full(kind.leaves, 0.35)], axis=1)
    places = outward * reach[:, None]
    places[:, 2] = kind.trunk_m + np.clip(level, 0.0, 1.0) * crown_m
    return places, outward / np.linalg.norm(outward, axis=1, keepdims=True)


def _cone_core(kind: TreeKind, height_m: float) -> TriangleMesh:
    crown_m = height_m - kind.trunk_m
    path = [(0, 0, kind.trunk_m), (0, 0, kind.trunk_m + 0.5 * crown_m), (0, 0, height_m)]
    wide = kind.crown[0] * crown_m
    return tube(path, [0.6 * wide, 0.3 * wide, 0.02], Material.FOLIAGE, _TAG, sides=7)


def _leaves(
    places: NDArray[np.float64],
    outward: NDArray[np.float64],
    middle: NDArray[np.float64],
    leaf_m: float,
    rng: np.random.Generator,
    *,
    droop: bool,
) -> TriangleMesh:
    """Pointed plates of one triangle each, wherever they may face."""
    count = len(places)
    along = rng.normal(size=(count, 3))
    if droop:
        along = outward * 2.0 + rng.normal(scale=0.35, size=(count, 3)) - np.array([0, 0, 0.9])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, outward + rng.normal(scale=0.6, size=(count, 3)))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    size = leaf_m * rng.uniform(0.7, 1.3, count)[:, None]
    wide = 0.3 if droop else 0.45
    corners = np.stack(
        [
            places + along * size * 0.6,
            places - along * size * 0.4 + across * size * wide,
            places - along * size * 0.4 - across * size * wide,
        ],
        axis=1,
    )
    triangles = np.arange(3 * count).reshape(-1, 3)
    soft = places - middle
    soft[:, 2] += 0.4 * np.abs(soft[:, 2]).max()
    soft /= np.linalg.norm(soft, axis=1, keepdims=True)
    soft = soft + 0.8 * outward + rng.normal(scale=0.25, size=(count, 3))
    soft /= np.linalg.norm(soft, axis=1, keepdims=True)
    normals = np.repeat(soft[:, None, :], 3, axis=1)
    return build_mesh(corners.reshape(-1, 3), triangles, Material.FOLIAGE, _TAG, normals=normals)
