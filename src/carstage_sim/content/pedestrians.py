"""Procedural pedestrians: standing and walking figures inside their capsule's box."""

from __future__ import annotations

import hashlib
import math

import numpy as np

from carstage_sim.content.figures import Build, Pose, add_figure
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh, build_mesh

Vector = tuple[float, float, float]

PHASES = 8
"""Poses of a walk; phase 0 of :func:`pedestrian_mesh` stands still, 1 to 8 walk."""


def dress_of(type_id: str) -> int:
    """Number (0-7) of the figure that stands for a blueprint: sleeves, skirt, long hair."""
    seed = hashlib.sha256(type_id.encode()).digest()
    return (seed[0] % 3 != 0) | (seed[1] % 4 == 0) << 1 | (seed[2] % 3 == 0) << 2


def pedestrian_mesh(type_id: str, extent: Vector, phase: int = 0) -> TriangleMesh:
    """A pedestrian in its actor's frame: x forward, y right, origin at mid height.

    Args:
        type_id: blueprint id; dress and proportions follow from it.
        extent: half sizes of the capsule's box, metres. CARLA's capsules are narrow, so steps are
            short: nothing leaves the box.
        phase: 0 for standing, 1 to 8 for a walk.

    Returns:
        A mesh of which every vertex lies in the box.
    """
    mesh = posed_mesh(type_id, extent, walking_joints(extent, phase))
    bound = np.array(extent) - 0.002
    clipped = np.clip(mesh.vertices, -bound, bound)
    return build_mesh(clipped, mesh.triangles, mesh.material, mesh.tag, normals=mesh.normals)


def walking_joints(extent: Vector, phase: int) -> Pose:
    """Joints of a figure that stands (0) or walks (1 to 8), in its actor's frame.

    Raises:
        ValueError: there is no such phase.
    """
    if not 0 <= phase <= PHASES:
        raise ValueError(f"phase must be 0 to {PHASES}, not {phase}")
    hx, hy, hz = extent
    return _walk(2.0 * hz - 0.015, hx, hy, phase)


def posed_mesh(type_id: str, extent: Vector, joints: Pose) -> TriangleMesh:
    """A pedestrian in any pose, which may leave its box."""
    dress = dress_of(type_id)
    hx, hy, hz = extent
    size = 2.0 * hz - 0.015
    build = Build(
        size=size,
        width=min(hy * 0.98, 0.135 * size),
        depth=min(hx * 0.85, 0.070 * size),
        sleeves=bool(dress & 1),
        skirt=bool(dress & 2),
        long_hair=bool(dress & 4),
    )
    builder = ShapeBuilder(CityObjectLabel.PEDESTRIANS)
    add_figure(builder, joints, build, CityObjectLabel.PEDESTRIANS)
    return builder.mesh()


def _walk(size: float, hx: float, hy: float, phase: int) -> Pose:
    """Joints of a walk's phase, origin at mid height."""

    def at(x: float, y: float, z: float) -> Array:
        # Heights are given for a figure of 1.8 m on the ground.
        return np.array([x, y, (z / 1.80 - 0.5) * size - 0.007])

    unit = size / 1.80
    turn = 2.0 * math.pi * (phase - 1) / PHASES
    swing = 0.0 if phase == 0 else min(0.26 * unit, hx * 0.92)
    reach = hy - 0.05 * unit
    shoulder_y = min(0.165 * unit, reach - 0.005)
    hip_y = min(0.095 * unit, hy * 0.5)
    ankles, knees, toes, hands, elbows = [], [], [], [], []
    for side in (0, 1):
        sign = -1.0 if side == 0 else 1.0
        a = turn + (0.0 if side == 0 else math.pi)
        forward = math.sin(a)
        lift = max(0.0, math.cos(a)) * (0.0 if phase == 0 else 1.0)
        foot_x = swing * 0.62 * forward - 0.035 * unit
        y = sign * hip_y
        ankles.append(at(foot_x, y, 0.085 + 0.06 * lift))
        knees.append(at(0.55 * foot_x + (0.025 + 0.10 * lift) * unit, y, 0.50 + 0.02 * lift))
        toes.append(
            at(min(foot_x + 0.165 * unit, hx - 0.035 * unit), y * 1.12, 0.035 + 0.03 * lift)
        )
        arm = -forward * swing * 0.75
        elbows.append(at(0.35 * arm - 0.02 * unit, sign * min(0.20 * unit, reach), 1.12))
        hands.append(
            at(arm + 0.02 * unit, sign * min(0.205 * unit, reach), 0.875 + 0.05 * abs(forward))
        )
    return Pose(
        pelvis=at(-0.005, 0.0, 0.96),
        neck=at(0.0, 0.0, 1.50),
        head=at(0.018 * unit, 0.0, 1.675),
        shoulder=(at(0.0, -shoulder_y, 1.42), at(0.0, shoulder_y, 1.42)),
        elbow=(elbows[0], elbows[1]),
        hand=(hands[0], hands[1]),
        hip=(at(-0.005, -hip_y, 0.93), at(-0.005, hip_y, 0.93)),
        knee=(knees[0], knees[1]),
        ankle=(ankles[0], ankles[1]),
        toe=(toes[0], toes[1]),
    )
