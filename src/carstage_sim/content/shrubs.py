"""Bushes, hedges, tufts of grass and the trees of a far wood: sprays of leaves without limbs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.solids import box, tube
from carstage_sim.content.trees import AUTUMN, GOLDEN_RAD, spray_triangles, unit
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_TAG = CityObjectLabel.VEGETATION
_BUSH_SPRAYS = 90
_FAR_SPRAYS = 34
_TUFT_CARDS = 3
_TUFT_SUNK_M = 0.03
_HEDGE_SPRAYS_PER_M2 = 38.0
_HEDGE_SPRAY_M = 0.42
_UNDER_LEAVES_M = 0.1


def bush_mesh(
    radius_m: float,
    rng: np.random.Generator,
    leaves: Material = Material.LEAVES_SMALL,
) -> TriangleMesh:
    """A bush that stands on the origin, a little wider than high."""
    count = _BUSH_SPRAYS
    outward = unit(rng.normal(size=(count, 3)))
    outward[:, 2] = np.abs(outward[:, 2])
    reach = radius_m * (0.5 + 0.45 * np.sqrt(rng.random(count)))
    places = outward * reach[:, None] * np.array([1.0, 1.0, 1.15])
    size = 0.62 * radius_m * rng.uniform(0.75, 1.25, count)
    places[:, 2] = np.maximum(places[:, 2], 0.62 * size)
    along = unit(outward + rng.normal(scale=0.7, size=(count, 3)) + np.array([0.0, 0.0, 0.5]))
    facing = unit(outward + np.array([0.0, 0.0, 0.4]) + rng.normal(scale=0.2, size=(count, 3)))
    core = _mound(0.5 * radius_m, 0.9 * radius_m)
    return merge_meshes([core, _sprays(places, along, facing, size, leaves, rng)])


def _mound(radius_m: float, height_m: float) -> TriangleMesh:
    """The dark inside of a bush: a cone with a round top."""
    sides = 7
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1) * radius_m
    belt = rim * 0.85 + np.array([0.0, 0.0, 0.6 * height_m])
    points = np.concatenate([rim, belt, [(0.0, 0.0, height_m)]])
    here = np.arange(sides)
    after = (here + 1) % sides
    triangles = np.concatenate(
        [
            np.stack([here, after, after + sides], axis=1),
            np.stack([here, after + sides, here + sides], axis=1),
            np.stack([here + sides, after + sides, np.full(sides, 2 * sides)], axis=1),
        ]
    )
    return build_mesh(points, triangles, Material.FOLIAGE, _TAG)


def hedge_mesh(
    length_m: float,
    height_m: float,
    width_m: float,
    rng: np.random.Generator,
    leaves: Material = Material.LEAVES_SMALL,
) -> TriangleMesh:
    """A clipped hedge along y whose middle stands on the origin; its foot is below ground."""
    half = np.array([0.5 * width_m, 0.5 * length_m, 0.5 * height_m])
    inner = half - _UNDER_LEAVES_M
    core = box((0.0, 0.0, inner[2] - _UNDER_LEAVES_M), tuple(inner), Material.FOLIAGE, _TAG)
    flank, top, end = half[1] * half[2], half[0] * half[1], half[0] * half[2]
    areas = 4.0 * np.array([flank, flank, top, end, end])
    count = int(areas.sum() * _HEDGE_SPRAYS_PER_M2)
    side = np.searchsorted(np.cumsum(areas) / areas.sum(), rng.random(count)).clip(0, 4)
    outward = np.array([(1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (0, -1, 0)], float)[side]
    size = _HEDGE_SPRAY_M * rng.uniform(0.75, 1.25, count)
    flat = rng.uniform(-1.0, 1.0, (count, 3)) * half
    places = np.where(outward != 0.0, outward * (half - 0.06), flat)
    places[:, 2] = (places[:, 2] + half[2]).clip(0.35 * size, None)
    along = unit(rng.normal(size=(count, 3)) + 0.25 * outward + np.array([0.0, 0.0, 0.3]))
    along -= 0.75 * outward * (along * outward).sum(axis=1, keepdims=True)
    facing = unit(outward + np.array([0.0, 0.0, 0.35]) + rng.normal(scale=0.25, size=(count, 3)))
    return merge_meshes([core, _sprays(places, unit(along), facing, size, leaves, rng)])


def tuft_mesh(places: NDArray[np.float64], rng: np.random.Generator) -> TriangleMesh:
    """Tufts of grass on the ground.

    Args:
        places: ``(N, 3)`` of their feet, metres.
        rng: turns them, and draws how high they are.
    """
    count = len(places) * _TUFT_CARDS
    angle = rng.uniform(0.0, 2 * np.pi, count)
    wide = rng.uniform(0.16, 0.34, count)[:, None]
    high = rng.uniform(0.14, 0.36, count)
    foot = np.repeat(places, _TUFT_CARDS, axis=0) - np.array([0.0, 0.0, _TUFT_SUNK_M])
    foot[:, :2] += rng.normal(scale=0.07, size=(count, 2))
    across = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1) * wide
    tip = foot + 0.3 * across
    tip[:, 2] += high + _TUFT_SUNK_M
    corners = np.stack([tip, foot + across, foot - across], axis=1)
    facing = unit(rng.normal(scale=0.25, size=(count, 3)) + np.array([0.0, 0.0, 1.0]))
    return build_mesh(
        corners.reshape(-1, 3),
        np.arange(3 * count).reshape(-1, 3),
        Material.BLADES,
        _TAG,
        normals=np.repeat(facing[:, None, :], 3, axis=1),
    )


def far_tree_mesh(
    height_m: float, rng: np.random.Generator, *, pointed: bool = False, autumn: bool = False
) -> TriangleMesh:
    """A tree that nobody comes near: a trunk and some large sprays.

    Args:
        height_m: of its top.
        rng: draws the sprays.
        pointed: a fir.
        autumn: its leaves have turned.
    """
    count = _FAR_SPRAYS
    level = rng.random(count) ** (1.6 if pointed else 1.0)
    wide = (1.0 - level) * 0.3 if pointed else 0.34 * np.sqrt(1.0 - (1.9 * level - 0.9) ** 2)
    angle = np.arange(count) * GOLDEN_RAD + rng.uniform(0.0, 0.8, count)
    away = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    places = away * (wide * height_m * 0.6)[:, None]
    low = 0.1 if pointed else 0.3
    places[:, 2] = height_m * (low + (0.93 - low) * level)
    size = height_m * (0.34 if not pointed else 0.14 + 0.16 * (1.0 - level))
    size = size * rng.uniform(0.8, 1.2, count)
    places[:, 2] = np.maximum(places[:, 2], 0.7 * size)
    up = np.array([0.0, 0.0, -0.8 if pointed else 0.3])
    along = unit(away + up + rng.normal(scale=0.6, size=(count, 3)))
    facing = unit(away + np.array([0.0, 0.0, 0.5]) + rng.normal(scale=0.2, size=(count, 3)))
    leaves = Material.NEEDLES if pointed else Material.LEAVES
    if autumn:
        leaves = AUTUMN.get(leaves, leaves)
    path = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.75 * height_m)]
    trunk = tube(
        path, [0.02 * height_m, 0.006 * height_m], Material.BARK, _TAG, sides=4, capped=False
    )
    return merge_meshes([trunk, _sprays(places, along, facing, size, leaves, rng)])


def _sprays(
    places: NDArray[np.float64],
    along: NDArray[np.float64],
    facing: NDArray[np.float64],
    size_m: NDArray[np.float64],
    leaves: Material,
    rng: np.random.Generator,
) -> TriangleMesh:
    corners = spray_triangles(places, along, facing, size_m, rng)
    return build_mesh(
        corners.reshape(-1, 3),
        np.arange(3 * len(places)).reshape(-1, 3),
        leaves,
        _TAG,
        normals=np.repeat(facing[:, None, :], 3, axis=1),
    )
