"""Which way the LiDAR's axes point, judged by the depth camera beside it."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from carstage.geometry import FloatArray, optical_from_world, project, transform_points
from carstage.selftest.depth_view import CLEARLY, DepthView
from carstage.selftest.verdict import Check
from carstage.selftest.warping import AGREES

EXPECTED = "x forward, y right, z up"
_ENOUGH = 0.6
_TICKS = (0, 3, 6)
_GROUND_M = 0.4
_FEWEST = 20
_SLACK_M = 0.1
_WORDS = (("forward", "backward"), ("right", "left"), ("up", "down"))


def check_lidar_axes(view: DepthView) -> Check:
    """How x, y and z of the points have to be read for them to lie on what the camera sees.

    Points on the ground say little, for a flat road is its own mirror image: only those above it
    are compared.
    """
    shares = {words: _agreement(view, axes) for words, axes in _readings()}
    found = max(shares, key=lambda words: shares[words])
    others = max(share for words, share in shares.items() if words != found)
    if shares[found] < _ENOUGH or shares[found] < CLEARLY * others:
        return Check("LiDAR axes", False, "no axes for certain", EXPECTED, shares[found])
    return Check("LiDAR axes", found == EXPECTED, found, EXPECTED, shares[found])


def _readings() -> list[tuple[str, FloatArray]]:
    """Words and ``(3, 3)`` matrix (CARLA axes from the points' own) of each way to read points."""
    readings = []
    for order in permutations(range(3)):
        for flipped in product((0, 1), repeat=3):
            matrix = np.zeros((3, 3))
            names = []
            for own, axis in enumerate(order):
                matrix[axis, own] = -1.0 if flipped[own] else 1.0
                names.append(f"{'xyz'[own]} {_WORDS[axis][flipped[own]]}")
            readings.append((", ".join(names), matrix))
    return readings


def _agreement(view: DepthView, axes: FloatArray) -> float:
    """Share of points above the ground that lie on the surface that the depth camera sees."""
    evidence = view.evidence
    assert evidence.world_from_lidar is not None
    hits = compared = 0
    for tick in _TICKS:
        world = transform_points(evidence.world_from_lidar[tick], evidence.points[tick] @ axes.T)
        start = evidence.world_from_ego[0]
        above = ((world - start[:3, 3]) @ start[:3, 2]) > _GROUND_M
        optical = transform_points(optical_from_world(evidence.world_from_camera[tick]), world)
        uv = project(optical, evidence.k)
        height, width = view.depth_m.shape[1:]
        shown = above & (uv >= 0.0).all(axis=-1) & (uv[:, 0] < width) & (uv[:, 1] < height)
        pixel = np.floor(uv[shown]).astype(np.int64)
        depth_m = view.depth_m[tick][pixel[:, 1], pixel[:, 0]]
        off_m = np.abs(depth_m - optical[shown, 2])
        hits += int(np.sum(off_m <= _SLACK_M + AGREES * depth_m))
        compared += len(pixel)
    return hits / compared if compared >= _FEWEST else 0.0
