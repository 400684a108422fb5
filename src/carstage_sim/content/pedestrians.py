"""Procedural pedestrians: figures of human width, standing, walking or posed."""

from __future__ import annotations

import hashlib
import math

import numpy as np

from carstage_sim.content.figures import Build, Pose, add_figure
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh

Vector = tuple[float, float, float]

PHASES = 8
"""Poses of a walk; phase 0 of :func:`walking_joints` stands still, 1 to 8 walk."""


def dress_of(type_id: str) -> int:
    """Number (0-7) of the figure that stands for a blueprint: sleeves, skirt, long hair."""
    seed = hashlib.sha256(type_id.encode()).digest()
    return (seed[0] % 3 != 0) | (seed[1] % 4 == 0) << 1 | (seed[2] % 3 == 0) << 2


def pedestrian_mesh(type_id: str, extent: Vector, joints: Pose) -> TriangleMesh:
    """A pedestrian in its actor's frame: x forward, y right, origin at mid height.

    CARLA's box of a walker is its collision capsule's, which is narrower than a human: arms and
    legs leave it, as they do in CARLA. In every pose the same triangles follow each other.

    Args:
        type_id: blueprint id; dress and proportions follow from it.
        extent: half sizes of the capsule's box, metres; the figure is as tall as the box.
        joints: where its joints are, see :func:`walking_joints`.
    """
    dress = dress_of(type_id)
    size = _size(extent)
    build = Build(
        size=size,
        width=0.105 * size,
        depth=0.070 * size,
        sleeves=bool(dress & 1),
        skirt=bool(dress & 2),
        long_hair=bool(dress & 4),
    )
    builder = ShapeBuilder(CityObjectLabel.PEDESTRIANS)
    add_figure(builder, joints, build, CityObjectLabel.PEDESTRIANS)
    return builder.mesh()


def walking_joints(extent: Vector, phase: int) -> Pose:
    """Joints of a figure that stands (0) or walks (1 to 8), in its actor's frame.

    Raises:
        ValueError: there is no such phase.
    """
    if not 0 <= phase <= PHASES:
        raise ValueError(f"phase must be 0 to {PHASES}, not {phase}")
    size = _size(extent)
    unit = size / 1.80

    def at(x: float, y: float, z: float) -> Array:
        # Metres of a figure of 1.8 m, heights above the ground.
        return np.array([x * unit, y * unit, (z / 1.80 - 0.5) * size - 0.007])

    turn = 2.0 * math.pi * (phase - 1) / PHASES
    walks = 0.0 if phase == 0 else 1.0
    ankles, knees, toes, hands, elbows = [], [], [], [], []
    for side in (0, 1):
        sign = -1.0 if side == 0 else 1.0
        a = turn + (0.0 if side == 0 else math.pi)
        forward = math.sin(a) * walks
        lift = max(0.0, math.cos(a)) * walks
        foot_x = 0.23 * forward - 0.035
        y = sign * 0.095
        ankles.append(at(foot_x, y, 0.085 + 0.06 * lift))
        knees.append(at(0.55 * foot_x + 0.025 + 0.10 * lift, y, 0.50 + 0.02 * lift))
        toes.append(at(foot_x + 0.165, y * 1.12, 0.035 + 0.03 * lift))
        arm = -0.24 * forward
        elbows.append(at(0.35 * arm - 0.02, sign * 0.225, 1.12))
        hands.append(at(arm + 0.02, sign * 0.235, 0.875 + 0.05 * abs(forward)))
    return Pose(
        pelvis=at(-0.005, 0.0, 0.96),
        neck=at(0.0, 0.0, 1.50),
        head=at(0.018, 0.0, 1.675),
        shoulder=(at(0.0, -0.180, 1.42), at(0.0, 0.180, 1.42)),
        elbow=(elbows[0], elbows[1]),
        hand=(hands[0], hands[1]),
        hip=(at(-0.005, -0.095, 0.93), at(-0.005, 0.095, 0.93)),
        knee=(knees[0], knees[1]),
        ankle=(ankles[0], ankles[1]),
        toe=(toes[0], toes[1]),
    )


def _size(extent: Vector) -> float:
    """Metres from sole to crown of the figure in a box."""
    return 2.0 * extent[2] - 0.015
