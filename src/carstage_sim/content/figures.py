"""Human figures out of limbs: bodies of pedestrians and riders, in any pose of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.mesh import Material


@dataclass(frozen=True, slots=True)
class Pose:
    """Joints of a figure in metres; left is -y. Limbs are (left, right).

    Attributes:
        pelvis, neck, head: middle of the pelvis, foot of the neck, middle of the head.
        shoulder, elbow, hand, hip, knee, ankle: one point for each side.
        toe: tip of each foot.
    """

    pelvis: Array
    neck: Array
    head: Array
    shoulder: tuple[Array, Array]
    elbow: tuple[Array, Array]
    hand: tuple[Array, Array]
    hip: tuple[Array, Array]
    knee: tuple[Array, Array]
    ankle: tuple[Array, Array]
    toe: tuple[Array, Array]


@dataclass(frozen=True, slots=True)
class Build:
    """Thickness and dress of a figure.

    Attributes:
        size: metres from sole to crown when standing; limbs scale with it.
        width: half width of the shoulders, metres.
        depth: largest half depth of the trunk, metres.
        sleeves: whether the arms are covered.
        skirt: whether a skirt covers the thighs.
        long_hair: hair down to the shoulders.
        helmet: material of a helmet, or None for hair.
        upper, lower: materials of the clothes.
        gloves: whether the hands are covered.
    """

    size: float
    width: float
    depth: float
    sleeves: bool = True
    skirt: bool = False
    long_hair: bool = False
    helmet: Material | None = None
    upper: Material = Material.CLOTH_UPPER
    lower: Material = Material.CLOTH_LOWER
    gloves: bool = False


def _between(a: Array, b: Array, shares: ArrayLike) -> Array:
    share = np.asarray(shares, np.float64)[:, None]
    line: Array = a + (b - a) * share
    return line


def add_figure(builder: ShapeBuilder, pose: Pose, build: Build, tag: int) -> None:
    """Add a figure: trunk, head with hair or helmet, arms and legs."""
    unit = build.size / 1.80
    skin = Material.SKIN
    trunk = _between(pose.pelvis, pose.neck, [-0.12, 0.0, 0.25, 0.5, 0.78, 0.93, 1.0])
    wide = build.width * np.array([0.66, 0.78, 0.70, 0.78, 0.86, 0.72, 0.30])
    depth = min(build.depth / (build.width * 0.80), 0.82)
    builder.limb(trunk[1:], wide[1:], build.upper, sides=10, squash=depth, tag=tag)
    builder.limb(trunk[:3], wide[:3] * 0.99, build.lower, sides=10, squash=depth, tag=tag)
    neck = _between(pose.neck, pose.head, [-0.1, 0.45, 0.7])
    builder.limb(neck, np.array([0.06, 0.052, 0.05]) * unit, skin, sides=6, tag=tag)
    up = (pose.head - pose.neck) / np.linalg.norm(pose.head - pose.neck)
    skull = pose.head + up * np.array([-0.115, -0.085, -0.03, 0.03, 0.08, 0.108])[:, None] * unit
    builder.limb(
        skull, np.array([0.032, 0.058, 0.074, 0.078, 0.056, 0.02]) * unit, skin, sides=8,
        squash=1.18, tag=tag,
    )  # fmt: skip
    back = np.array([-0.012, 0.0, 0.0]) * unit
    cover = build.helmet if build.helmet is not None else Material.HAIR
    low = -0.10 if build.long_hair and build.helmet is None else -0.005
    offsets = np.array([low, 0.03, 0.085, 0.118])[:, None] * unit
    hair = pose.head + up * offsets + back * np.array([2.2, 1.0, 0.8, 0.8])[:, None]
    grown = 1.16 if build.helmet is not None else 1.06
    builder.limb(
        hair, np.array([0.066, 0.083, 0.064, 0.02]) * unit * grown, cover, sides=8, squash=1.14,
        tag=tag,
    )  # fmt: skip
    for side in (0, 1):
        _add_arm(builder, pose, build, side, tag)
        _add_leg(builder, pose, build, side, tag)
    if build.skirt:
        hem = (pose.knee[0] + pose.knee[1]) / 2 + np.array([0.0, 0.0, 0.06]) * unit
        skirt = _between(pose.pelvis, hem, [0.0, 0.5, 1.0])
        builder.limb(
            skirt, build.width * np.array([0.78, 0.84, 0.86]), build.lower, sides=10,
            squash=min(depth * 1.1, 0.95), tag=tag,
        )  # fmt: skip


def _add_arm(builder: ShapeBuilder, pose: Pose, build: Build, side: int, tag: int) -> None:
    unit = build.size / 1.80
    shoulder, elbow, hand = pose.shoulder[side], pose.elbow[side], pose.hand[side]
    line = np.concatenate([[shoulder], _between(shoulder, elbow, [0.15, 1.0])])
    upper = np.array([0.030, 0.052, 0.042]) * unit
    builder.limb(line, upper, build.upper, sides=6, tag=tag)
    fore = _between(elbow, hand, [0.0, 0.3, 0.85])
    material = build.upper if build.sleeves else Material.SKIN
    builder.limb(fore, np.array([0.041, 0.042, 0.03]) * unit, material, sides=6, tag=tag)
    palm = _between(elbow, hand, [0.83, 0.95, 1.12])
    hands = Material.SHOE if build.gloves else Material.SKIN
    builder.limb(palm, np.array([0.026, 0.036, 0.018]) * unit, hands, sides=5, tag=tag)


def _add_leg(builder: ShapeBuilder, pose: Pose, build: Build, side: int, tag: int) -> None:
    unit = build.size / 1.80
    hip, knee, ankle, toe = pose.hip[side], pose.knee[side], pose.ankle[side], pose.toe[side]
    thigh = _between(hip, knee, [-0.1, 0.15, 0.6, 1.0])
    bare = build.skirt
    builder.limb(
        thigh, np.array([0.06, 0.082, 0.068, 0.054]) * unit,
        Material.SKIN if bare else build.lower, sides=8, tag=tag,
    )  # fmt: skip
    shin = _between(knee, ankle, [0.0, 0.3, 0.75, 1.0])
    builder.limb(
        shin, np.array([0.054, 0.058, 0.044, 0.042]) * unit,
        Material.SKIN if bare else build.lower, sides=8, tag=tag,
    )  # fmt: skip
    sole = np.array([0.0, 0.0, 1.0])
    heel = ankle - (toe - ankle) * 0.25
    foot = np.stack([heel - sole * 0.035 * unit, ankle - sole * 0.03 * unit, toe])
    builder.limb(
        foot, np.array([0.034, 0.042, 0.030]) * unit, Material.SHOE, sides=6, squash=0.9, tag=tag
    )
