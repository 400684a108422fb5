"""How people stand, walk and run: joints as a function of the way they have come.

A foot that is on the ground stays where it is: it comes down on the heel, lies flat and leaves over
its tip while the body moves on. Knees and elbows follow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from carstage_sim.content.lofting import Array
from carstage_sim.content.posing import REST_TOE, Pose

Vector = tuple[float, float, float]
Gait = Literal["stand", "walk", "run"]

WALK_PHASES, RUN_PHASES = 48, 32
PHASES = WALK_PHASES + RUN_PHASES
"""Poses of a figure: phase 0 stands, the next :data:`WALK_PHASES` walk, the others run."""

_SIDES = (-1.0, 1.0)
_THIGH, _SHIN, _UPPER_ARM, _FOREARM = 0.429, 0.429, 0.280, 0.255
_HOLDING = (0.05, 0.02, 2.40)
"""Angle ahead and aside of an upper arm, bend of the elbow, of a hand before the chest."""
_HEEL, _TIP = (-0.06, -0.085), (0.165, -0.085)
"""Where a foot meets the ground, ahead of and above its ankle."""


@dataclass(frozen=True, slots=True)
class _Manner:
    """A gait of a figure of 1.8 m; metres, radians, and shares of two steps.

    Attributes:
        stride: way of two steps.
        stance: share in which a foot is on the ground.
        middle: where a foot is, ahead of the hips, in the middle of its stance.
        strike, push: how far the toes point up at first and down at last.
        flat, rise: shares of the stance at which the foot lies down and the heel leaves.
        lift: how high the foot swings.
        hips: height of the hip joints; ``bob`` is how much it goes up and down.
        lean: how far the neck is ahead of the pelvis.
        swing, bend: of arms: to both sides of their mean, bend of the elbow.
        turn: of hips and shoulders.
    """

    stride: float
    stance: float
    middle: float
    strike: float
    push: float
    flat: float
    rise: float
    lift: float
    hips: float
    bob: float
    lean: float
    swing: float
    bend: float
    turn: float


_WALK = _Manner(
    1.30, 0.61, -0.035, 0.34, 0.68, 0.16, 0.60, 0.030, 0.912, 0.020, 0.015, 0.36, 0.24, 0.09
)
_RUN = _Manner(
    1.70, 0.36, -0.050, 0.10, 0.80, 0.20, 0.55, 0.150, 0.895, -0.022, 0.110, 0.50, 1.70, 0.13
)


def stride_m(size_m: float, gait: Gait) -> float:
    """Way of two steps of a figure of a size from sole to crown."""
    return (_RUN if gait == "run" else _WALK).stride * size_m / 1.80


def gait_at(size_m: float, speed_m_s: float) -> Gait:
    """What a figure does at a speed; small ones run sooner."""
    if speed_m_s < 0.15:
        return "stand"
    return "run" if speed_m_s > 2.2 * math.sqrt(size_m / 1.80) else "walk"


def size_m(extent: Vector) -> float:
    """Metres from sole to crown of the figure in a box."""
    return 2.0 * extent[2] - 0.015


def head_size(size: float) -> float:
    """Size of the head over that of a grown-up, in a figure of a size: children's are larger."""
    return 1.0 + 0.36 * min(max((1.62 - size) / 0.55, 0.0), 1.0)


def joints_at(extent: Vector, phase: int, *, stoop: float = 0.0, holds: bool = False) -> Pose:
    """Joints of a figure in its actor's frame: x forward, y right, origin at mid height.

    Args:
        extent: half sizes of the capsule's box, metres; the figure is as tall as the box.
        phase: 0 to :data:`PHASES`.
        stoop: how far neck and head are bent forward, metres of a figure of 1.8 m.
        holds: the right hand is before the chest, and the arm does not swing.

    Raises:
        ValueError: there is no such phase.
    """
    if not 0 <= phase <= PHASES:
        raise ValueError(f"phase must be 0 to {PHASES}, not {phase}")
    if phase == 0:
        body = _standing()
    elif phase <= WALK_PHASES:
        body = _moving(_WALK, (phase - 0.5) / WALK_PHASES)
    else:
        body = _moving(_RUN, (phase - WALK_PHASES - 0.5) / RUN_PHASES)
    if holds:
        body.arms[1] = _HOLDING
    size = size_m(extent)
    return _placed(body, size, head_size(size), stoop)


@dataclass(slots=True)
class _Body:
    """Joints of a figure of 1.8 m, heights above the ground; limbs are (left, right)."""

    hips: list[Array]
    knees: list[Array]
    ankles: list[Array]
    toes: list[Array]
    turn: float
    """Angle by which the shoulders are turned to the left."""
    lean: float
    arms: list[tuple[float, float, float]]
    """Angle ahead and aside of each upper arm, bend of the elbow."""


def _placed(body: _Body, size: float, head: float, stoop: float) -> Pose:
    unit = size / 1.80
    # A larger head takes its room from the neck and the trunk.
    down = 0.195 * (head - 1.0)
    pelvis = (body.hips[0] + body.hips[1]) / 2 + np.array([0.0, 0.0, 0.03])
    drop = pelvis[2] - 0.955
    lean = body.lean
    neck = np.array([pelvis[0] + lean + 0.5 * stoop, 0.0, 1.510 - down + drop - 0.1 * lean])
    top = 1.682 - 0.1165 * (head - 1.0)
    crown = np.array([neck[0] + 0.022 + 0.15 * lean + 0.5 * stoop, 0.0, top + drop - 0.05 * lean])
    c, s = math.cos(body.turn), math.sin(body.turn)
    width = 0.178 - 0.02 * (head - 1.0)
    shoulders, elbows, hands = [], [], []
    for side, (ahead, aside, bend) in enumerate(body.arms):
        sign = _SIDES[side]
        shoulder = neck + np.array([sign * width * s, sign * width * c, -0.098])
        upper = np.array([math.sin(ahead), sign * math.sin(aside), -math.cos(ahead)])
        elbow = shoulder + upper / np.linalg.norm(upper) * (_UPPER_ARM - 0.4 * down)
        fore = np.array([math.sin(ahead + bend), -sign * 0.05, -math.cos(ahead + bend)])
        shoulders.append(shoulder)
        elbows.append(elbow)
        hands.append(elbow + fore / np.linalg.norm(fore) * (_FOREARM - 0.4 * down))

    def at(point: Array) -> Array:
        moved: Array = np.array(
            [point[0] * unit, point[1] * unit, (point[2] / 1.80 - 0.5) * size - 0.007]
        )
        return moved

    def pair(points: list[Array]) -> tuple[Array, Array]:
        return at(points[0]), at(points[1])

    return Pose(
        pelvis=at(pelvis), neck=at(neck), head=at(crown), shoulder=pair(shoulders),
        elbow=pair(elbows), hand=pair(hands), hip=pair(body.hips), knee=pair(body.knees),
        ankle=pair(body.ankles), toe=pair(body.toes),
    )  # fmt: skip


def _standing() -> _Body:
    """At ease: the weight on one leg, the other a little ahead and turned out."""
    hips = [np.array([0.0, -0.095, 0.928]), np.array([0.0, 0.095, 0.918])]
    ankles = [np.array([-0.03, -0.10, 0.085]), np.array([0.05, 0.135, 0.085])]
    toes = [
        ankle + np.array([0.187, sign * out, REST_TOE[1]])
        for ankle, sign, out in zip(ankles, _SIDES, (0.03, 0.06), strict=True)
    ]
    knees = [_knee(*joints) for joints in zip(hips, ankles, strict=True)]
    arms = [(0.02, 0.13, 0.20), (-0.02, 0.15, 0.28)]
    return _Body(hips, knees, ankles, toes, 0.03, 0.012, arms)


def _moving(manner: _Manner, phase: float) -> _Body:
    """A walk or run; the left heel comes down at phase 0."""
    turns = [phase, (phase + 0.5) % 1.0]
    # Twice in two steps the body is lowest: with both feet on the ground, or on one in a run.
    height = manner.hips - manner.bob * math.cos(4.0 * math.pi * (phase - 0.02))
    sway = 0.018 * math.sin(2.0 * math.pi * (phase - 0.05))
    yaw = manner.turn * math.cos(2.0 * math.pi * phase)
    hips, knees, ankles, toes, arms = [], [], [], [], []
    for side, turn in enumerate(turns):
        sign = _SIDES[side]
        x, z, pitch = _foot(manner, turn)
        y = sign * 0.085
        hip = np.array([-sign * 0.09 * yaw, sign * 0.09 - sway, height])
        ankle = np.array([x, y, z])
        toe = _turned(REST_TOE, pitch)
        hips.append(hip)
        knees.append(_knee(hip, ankle))
        ankles.append(ankle)
        toes.append(ankle + np.array([toe[0], sign * 0.02, toe[1]]))
        ahead = -math.cos(2.0 * math.pi * turn)
        bend = manner.bend + 0.14 * ahead
        arms.append((0.01 + manner.swing * ahead - 0.25 * max(manner.bend - 0.5, 0), 0.13, bend))
    return _Body(hips, knees, ankles, toes, yaw, manner.lean, arms)


def _turned(point: tuple[float, float], pitch: float) -> tuple[float, float]:
    c, s = math.cos(pitch), math.sin(pitch)
    return point[0] * c - point[1] * s, point[0] * s + point[1] * c


def _foot(manner: _Manner, turn: float) -> tuple[float, float, float]:
    """Ankle ahead of the hips, its height, and the foot's pitch, at a share of two steps."""
    stance = manner.stance
    if turn <= stance:
        return _foot_on_ground(manner, turn)
    start, end = _foot_on_ground(manner, stance), _foot_on_ground(manner, 0.0)
    step = 1e-4
    before = _foot_on_ground(manner, stance - step)
    after = _foot_on_ground(manner, step)
    u, length = (turn - stance) / (1.0 - stance), 1.0 - stance
    x, z = (
        _eased(start[k], end[k], (start[k] - before[k]) / step * length,
               (after[k] - end[k]) / step * length, u)
        for k in (0, 1)
    )  # fmt: skip
    early = min(1.0, u * 1.25)
    pitch = start[2] + (end[2] - start[2]) * early * early * (3.0 - 2.0 * early)
    return x, z + manner.lift * math.sin(math.pi * u) ** 2, pitch


def _eased(a: float, b: float, slope_a: float, slope_b: float, u: float) -> float:
    """A cubic between two values with slopes at both ends (Hermite)."""
    v = 1.0 - u
    return (
        (1 + 2 * u) * v * v * a
        + u * v * v * slope_a
        + u * u * (3 - 2 * u) * b
        - u * u * v * slope_b
    )


def _foot_on_ground(manner: _Manner, turn: float) -> tuple[float, float, float]:
    flat_x = manner.middle + manner.stride * (manner.stance / 2.0 - turn)
    share = turn / manner.stance
    if share < manner.flat:
        pitch, pivot = manner.strike * (1.0 - share / manner.flat) ** 2, _HEEL
    elif share > manner.rise:
        left = (share - manner.rise) / (1.0 - manner.rise)
        pitch, pivot = -manner.push * left**1.7, _TIP
    else:
        return flat_x, 0.085, 0.0
    x, z = _turned(pivot, pitch)
    return flat_x + pivot[0] - x, -z, pitch


def _knee(hip: Array, ankle: Array) -> Array:
    """The knee of a leg that bends forward."""
    return joint_between(hip, ankle, (_THIGH, _SHIN), np.array([1.0, 0.0, 0.0]))


def joint_between(start: Array, end: Array, lengths: tuple[float, float], toward: Array) -> Array:
    """The middle joint of a limb that bends towards a side; one that is too short is straight.

    Args:
        start, end: ``(3,)`` the outer joints.
        lengths: of both bones, in the unit of the places.
        toward: ``(3,)`` where the joint stands out to.
    """
    limb = end - start
    length = float(np.linalg.norm(limb))
    along = limb / length
    out = toward - (toward * along).sum() * along
    out = out / np.linalg.norm(out)
    upper, lower = lengths
    reach = min(length, upper + lower - 1e-6)
    part = (upper**2 - lower**2 + reach**2) / (2.0 * reach)
    away = math.sqrt(max(upper**2 - part**2, 0.0))
    joint: Array = start + along * part * (length / reach) + out * away
    return joint
