"""Street furniture: traffic lights, lamps, signs, benches, bins, bollards.

Every mesh stands on the origin of its own frame (CARLA axes, metres).
"""

from __future__ import annotations

import math

import numpy as np

from carstage_sim.content.solids import box, disc, quad_mesh, tube
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes

_LIGHT, _POLE = CityObjectLabel.TRAFFIC_LIGHT, CityObjectLabel.POLES
_LENSES = (Material.LIGHT_RED, Material.LIGHT_YELLOW, Material.LIGHT_GREEN)
_LENS_RADIUS_M = 0.12
_LENS_SPACING_M = 0.32
_SECOND_HEAD_HEIGHT_M = 3.0


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
    arm_height = z + 0.35
    metal = Material.METAL
    parts = [
        tube([(0, 0, 0.0), (0, 0, 0.35)], 0.19, metal, _POLE, sides=10),
        tube([(0, 0, 0.35), (0, 0, arm_height + 0.25)], [0.11, 0.075], metal, _POLE, sides=10),
        _head(np.array([x, y, z]), yaw_deg),
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
    facing = np.array([math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))])
    beside = facing * 0.22
    parts.append(_head(np.array([beside[0], beside[1], _SECOND_HEAD_HEIGHT_M]), yaw_deg))
    parts.append(
        box(
            (beside[0] / 2, beside[1] / 2, _SECOND_HEAD_HEIGHT_M),
            (0.1, 0.03, 0.04),
            metal,
            _POLE,
            yaw_deg=yaw_deg,
        )
    )
    return merge_meshes(parts)


def _head(middle: np.ndarray, yaw_deg: float) -> TriangleMesh:
    """A housing with three hooded lenses, red on top."""
    dark = Material.PLASTIC_DARK
    forward = np.array([math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg)), 0.0])
    side = np.array([-forward[1], forward[0], 0.0])
    up = np.array([0.0, 0.0, 1.0])
    parts = [
        box(middle, (0.11, 0.17, 0.52), dark, _LIGHT, yaw_deg=yaw_deg),
        # The backplate makes the lenses stand out against the sky.
        box(middle - forward * 0.1, (0.01, 0.27, 0.63), dark, _LIGHT, yaw_deg=yaw_deg),
    ]
    for lens, shift in zip(_LENSES, (1, 0, -1), strict=True):
        center = middle + up * (shift * _LENS_SPACING_M) + forward * 0.115
        parts.append(disc(center, forward, _LENS_RADIUS_M, lens, _LIGHT, sides=14))
        angle = np.radians(np.linspace(-10.0, 190.0, 9))
        rim = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
        near = center + 0.135 * rim
        far = near + forward * 0.17
        hood = np.stack([near[:-1], near[1:], far[1:], far[:-1]], axis=1)
        parts.append(quad_mesh(hood, dark, _LIGHT))
    return merge_meshes(parts)
