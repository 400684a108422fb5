"""Open doors of a vehicle: leaves that stand off its closed body.

The bodies are shells without openings, so behind an open leaf the door still looks closed; what a
sensor should notice, a leaf in the way, is there.
"""

from __future__ import annotations

import math

from carstage_sim.content.solids import box
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes

FRONT_LEFT, FRONT_RIGHT, REAR_LEFT, REAR_RIGHT = 1, 2, 4, 8
"""Bits ``1 << carla.VehicleDoor``."""
_ANGLE_DEG = 62.0
_THICK_M = 0.05
# Shares of the half length (hinge, leaf) and of the height (sill, belt line, top of the window).
_FRONT = (0.26, 0.40)
_REAR = (-0.16, 0.34)
_SILL, _BELT, _TOP = 0.20, 0.58, 0.90


def open_doors_mesh(
    extent: tuple[float, float, float],
    center: tuple[float, float, float],
    doors: int,
    tag: CityObjectLabel,
) -> TriangleMesh | None:
    """The leaves of open side doors in the vehicle's frame, None for no side door.

    Args:
        extent: half sizes of the vehicle's box, metres.
        center: the box's centre in the vehicle's frame.
        doors: bits of the doors that are open; hood and trunk have no leaf.
        tag: semantic label of the vehicle.
    """
    leaves = []
    for bit, side, (hinge, share) in (
        (FRONT_LEFT, -1.0, _FRONT),
        (FRONT_RIGHT, 1.0, _FRONT),
        (REAR_LEFT, -1.0, _REAR),
        (REAR_RIGHT, 1.0, _REAR),
    ):
        if not doors & bit:
            continue
        x = center[0] + hinge * extent[0]
        # Mirrors reach to the box's side, the body does not.
        y = center[1] + side * 0.90 * extent[1]
        length = share * extent[0]
        # A closed leaf points backwards from its hinge; an open one has swung outwards.
        turned = math.radians(180.0 - side * _ANGLE_DEG)
        middle = (x + math.cos(turned) * length / 2, y + math.sin(turned) * length / 2)
        for low, high, material, thick in (
            (_SILL, _BELT, Material.PAINT, _THICK_M),
            (_BELT, _TOP, Material.GLASS, _THICK_M / 3),
        ):
            height = 2.0 * extent[2]
            bottom = center[2] - extent[2]
            leaves.append(
                box(
                    (*middle, bottom + height * (low + high) / 2),
                    (length / 2, thick / 2, height * (high - low) / 2),
                    material,
                    tag,
                    yaw_deg=math.degrees(turned),
                )
            )
    return merge_meshes(leaves) if leaves else None
