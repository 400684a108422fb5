"""People in wheelchairs: the chair, the wheels that turn with its way, and who pushes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np

from carstage_sim.content.figures import Dress, figure_of
from carstage_sim.content.lofting import Array, ShapeBuilder, uniform
from carstage_sim.content.people import dress_of
from carstage_sim.content.posing import REST_TOE, Figure, Pose, stacked
from carstage_sim.content.walking import WALK_PHASES, Vector, joint_between
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

EXTENT: Final[Vector] = (0.515, 0.36, 0.73)
"""Half sizes, metres, of the box around a chair and who sits in it; the origin is its middle."""
ROLL_PHASES: Final = WALK_PHASES
"""Poses of one turn of the large wheels; phase 0 is that of phase 1."""

_SIZE_M = 1.845
"""Of who sits in it, standing from sole to crown: only grown-ups use it, all of one height."""
_UNIT = _SIZE_M / 1.80
_MIDDLE = np.array([0.043, 0.0, EXTENT[2]])
"""Middle of the box in the chair's axes: ahead, right and up from the ground below the seat."""
_SIDES = (-1.0, 1.0)

_AXLE_X, _RADIUS, _WHEEL_Y = -0.12, 0.305, 0.285
_RIM_RADIUS, _RIM_Y = 0.262, 0.322
_PUSHES = 2
"""Pushes of both hands in one turn of the wheels."""
_PUSH_FROM, _PUSH_BY = 1.97, 0.90
"""Angle from ahead at which hands take hold of the rims, and for how much they keep it."""
_WRIST = 0.060
"""From the rim to the wrist of a fist around it."""
_LIFT = 0.045
"""How far hands leave the rims on their way back."""


def roll_m() -> float:
    """Way of one turn of the large wheels, metres."""
    return 2.0 * math.pi * _RADIUS


def seated_dress(type_id: str) -> Dress:
    """A blueprint's dress without what hangs from shoulders and hands, in trousers."""
    dress = dress_of(type_id)
    covered = dress.bottom in ("trousers", "leggings", "shorts")
    return replace(
        dress,
        top="jacket" if dress.top == "coat" else "tee" if dress.top == "dress" else dress.top,
        bottom=dress.bottom if covered else "trousers",
        bag="none",
        held="nothing",
        fists=True,
    )


def seated_joints(phase: int) -> Pose:
    """Joints of who sits in a wheelchair, in the actor's frame: x forward, y right.

    Args:
        phase: 0 to :data:`ROLL_PHASES`; hands that push keep to one place of the rims.

    Raises:
        ValueError: there is no such phase.
    """
    angle, away = _grip(_turn(phase))
    pelvis = np.array([-0.150, 0.0, 0.588])
    neck = np.array([-0.195, 0.0, 1.156])
    head = neck + np.array([0.034, 0.0, 0.174])
    limbs: dict[str, list[Array]] = {
        name: [] for name in ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "hand")
    }
    for sign in _SIDES:
        hip = np.array([-0.150, sign * 0.090, 0.558])
        ankle = np.array([0.355, sign * 0.085, 0.155])
        shoulder = neck + np.array([0.0, sign * 0.178 * _UNIT, -0.100])
        hand = np.array(
            [
                _AXLE_X + away * math.cos(angle), sign * _RIM_Y, _RADIUS + away * math.sin(angle),
            ]
        )  # fmt: skip
        legs, arms = (0.429 * _UNIT, 0.429 * _UNIT), (0.280 * _UNIT, 0.255 * _UNIT)
        joints = {
            "hip": hip,
            "knee": joint_between(hip, ankle, legs, np.array([1.0, sign * 0.05, 1.0])),
            "ankle": ankle,
            "toe": ankle + np.array([REST_TOE[0], sign * 0.02, REST_TOE[1]]) * _UNIT,
            "shoulder": shoulder,
            "elbow": joint_between(shoulder, hand, arms, np.array([-1.0, sign * 0.12, 0.0])),
            "hand": hand,
        }
        for name, place in joints.items():
            limbs[name].append(place - _MIDDLE)
    pairs = {name: (places[0], places[1]) for name, places in limbs.items()}
    return Pose(pelvis=pelvis - _MIDDLE, neck=neck - _MIDDLE, head=head - _MIDDLE, **pairs)


def wheelchair_mesh(type_id: str, joints: Pose, phase: int) -> TriangleMesh:
    """A wheelchair and who sits in it, in any pose, in the actor's frame; label of pedestrians.

    Raises:
        ValueError: there is no such phase.
    """
    figure = _figure(type_id)
    return _mesh(figure, figure.vertices(joints), phase)


def wheelchair_meshes(type_id: str, phases: Sequence[int]) -> list[TriangleMesh]:
    """The same in several phases at once; in each the same triangles follow each other.

    Raises:
        ValueError: there is no such phase.
    """
    figure = _figure(type_id)
    joints = stacked([seated_joints(phase) for phase in phases])
    bodies = zip(figure.vertices(joints), phases, strict=True)
    return [_mesh(figure, vertices, phase) for vertices, phase in bodies]


def _figure(type_id: str) -> Figure:
    return figure_of(seated_dress(type_id), _SIZE_M)


def _mesh(figure: Figure, vertices: Array, phase: int) -> TriangleMesh:
    body = build_mesh(
        vertices, figure.triangles, figure.material, CityObjectLabel.PEDESTRIANS,
        normals=figure.normals(vertices),
    )  # fmt: skip
    return merge_meshes([body, _frame(), _rolled(_wheels(), 2.0 * math.pi * _turn(phase))])


def _turn(phase: int) -> float:
    if not 0 <= phase <= ROLL_PHASES:
        raise ValueError(f"phase must be 0 to {ROLL_PHASES}, not {phase}")
    return (max(phase, 1) - 0.5) / ROLL_PHASES


def _grip(turn: float) -> tuple[float, float]:
    """Angle from ahead and distance from the axle of both wrists, in a share of one turn."""
    cycle = turn * _PUSHES % 1.0
    pushing = _PUSH_BY * _PUSHES / (2.0 * math.pi)
    if cycle < pushing:
        return _PUSH_FROM - _PUSH_BY * cycle / pushing, _RIM_RADIUS + _WRIST
    back = (cycle - pushing) / (1.0 - pushing)
    eased = back * back * (3.0 - 2.0 * back)
    lift = _LIFT * math.sin(math.pi * back)
    return _PUSH_FROM - _PUSH_BY * (1.0 - eased), _RIM_RADIUS + _WRIST + lift


def _rolled(mesh: TriangleMesh, angle: float) -> TriangleMesh:
    """The wheels turned forward about their axle, and put in place."""
    c, s = math.cos(angle), math.sin(angle)
    axle = np.array([_AXLE_X, 0.0, _RADIUS]) - _MIDDLE

    def turned(vectors: Array) -> Array:
        x, z = vectors[..., 0], vectors[..., 2]
        return np.stack([c * x + s * z, vectors[..., 1], c * z - s * x], axis=-1)

    vertices = turned(mesh.vertices.astype(np.float64)) + axle
    normals = turned(mesh.normals.astype(np.float64))
    return replace(mesh, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


@cache
def _wheels() -> TriangleMesh:
    """Both large wheels and their rims to push, about the origin."""
    builder = ShapeBuilder(CityObjectLabel.PEDESTRIANS)
    for sign in _SIDES:
        middle = (0.0, sign * _WHEEL_Y, 0.0)
        _ring(builder, middle, _RADIUS - 0.014, 0.014, Material.RUBBER, 26)
        _ring(builder, middle, _RADIUS - 0.033, 0.009, Material.RIM, 26)
        _ring(builder, (0.0, sign * _RIM_Y, 0.0), _RIM_RADIUS, 0.008, Material.METAL, 22)
        ends = (-0.028, 0.028)
        hub = [(0.001, ends[0]), (0.020, ends[0]), (0.020, ends[1]), (0.001, ends[1])]
        builder.lathe(middle, hub, uniform(Material.METAL, 3, 8), segments=8)
        for k in range(12):
            angle = 2.0 * math.pi * k / 12
            way = np.array([math.cos(angle), 0.0, math.sin(angle)])
            foot = np.array(middle) + 0.018 * way + np.array([0.0, 0.02 * (-1) ** k, 0.0])
            tip = np.array(middle) + (_RADIUS - 0.036) * way
            builder.limb([foot, tip], [0.0028, 0.0028], Material.RIM, sides=3)
            if k % 4 == 0:
                rim = np.array([0.0, sign * _RIM_Y, 0.0]) + _RIM_RADIUS * way
                _tube(builder, tip, rim, 0.005, Material.METAL)
    return builder.mesh()


@cache
def _frame() -> TriangleMesh:
    """All but the large wheels: tubes, seat, back, castors and what feet stand on."""
    builder = ShapeBuilder(CityObjectLabel.PEDESTRIANS)
    for sign in _SIDES:
        _add_side(builder, sign)
        _add_castor(builder, sign)
    for sign in _SIDES:
        _tube(builder, (0.02, -sign * 0.21, 0.20), (0.02, sign * 0.21, 0.455), 0.011)
    builder.box((-0.28, -0.205, 0.448), (0.27, 0.205, 0.482), Material.SEAT)
    back = [[(x, y, z) for y in (-0.215, 0.0, 0.215)]
            for x, z in ((-0.283, 0.47), (-0.312, 0.68), (-0.330, 0.88))]  # fmt: skip
    sheet = np.array(back)
    sheet[:, 1, 0] -= 0.025
    for thick in (0.0, 0.014):
        builder.grid(sheet - np.array([thick, 0.0, 0.0]), Material.SEAT)
    mesh = builder.mesh()
    return replace(mesh, vertices=(mesh.vertices - _MIDDLE).astype(np.float32))


def _add_side(builder: ShapeBuilder, sign: float) -> None:
    """Tubes, push handle, arm rest and foot plate of one side."""
    y = sign * 0.222
    cane = [(-0.268, y, 0.28), (-0.300, y, 0.66), (-0.332, y, 0.925)]
    builder.limb(cane, [0.012] * 3, Material.METAL, sides=5)
    grip = [(-0.328, y, 0.925), (-0.37, y, 0.938), (-0.47, y, 0.938)]
    builder.limb(grip, [0.012, 0.016, 0.016], Material.PLASTIC_DARK, sides=5)
    _tube(builder, (-0.268, y, 0.285), (0.27, y, 0.285), 0.012)
    front = [(-0.28, y, 0.462), (0.26, y, 0.462), (0.325, sign * 0.20, 0.36),
             (0.37, sign * 0.17, 0.065)]  # fmt: skip
    builder.limb(front, [0.012] * 4, Material.METAL, sides=5)
    _tube(builder, (0.24, y, 0.275), (0.24, y, 0.462), 0.012)
    _tube(builder, (_AXLE_X, y, _RADIUS), (_AXLE_X, sign * _WHEEL_Y, _RADIUS), 0.010)
    _tube(builder, (0.10, y, 0.462), (0.10, y, 0.665), 0.010)
    inner, outer = sorted((sign * 0.210, sign * 0.258))
    builder.box((-0.24, inner, 0.660), (0.12, outer, 0.688), Material.PLASTIC_DARK)
    near, far = sorted((sign * 0.030, sign * 0.170))
    builder.box((0.285, near, 0.052), (0.500, far, 0.066), Material.PLASTIC_DARK)


def _add_castor(builder: ShapeBuilder, sign: float) -> None:
    """A small front wheel in its fork."""
    x, y, radius = 0.225, sign * 0.222, 0.085
    _tube(builder, (0.26, y, 0.29), (0.26, y, 0.195), 0.013)
    for aside in (-0.020, 0.020):
        _tube(builder, (0.26, y + aside, 0.195), (x, y + aside, radius), 0.006)
    _tube(builder, (0.26, y - 0.022, 0.195), (0.26, y + 0.022, 0.195), 0.008)
    profile = [(0.001, -0.012), (0.062, -0.012), (radius, -0.008), (radius, 0.008),
               (0.062, 0.012), (0.001, 0.012)]  # fmt: skip
    material = uniform(Material.RUBBER, 5, 16)
    material[[0, 4]] = Material.PLASTIC_DARK
    builder.lathe((x, y, radius), profile, material, segments=16)


def _tube(
    builder: ShapeBuilder, one: Vector | Array, other: Vector | Array, radius: float,
    material: Material = Material.METAL,
) -> None:  # fmt: skip
    builder.limb(np.array([one, other], np.float64), [radius, radius], material, sides=5)


def _ring(
    builder: ShapeBuilder, middle: Vector, radius: float, thick: float, material: Material,
    segments: int,
) -> None:  # fmt: skip
    """A ring about the y axis whose section is a triangle, or a square for tyres."""
    profile = [(radius - thick, 0.0), (radius, -thick), (radius + thick, 0.0), (radius, thick)]
    if material != Material.RUBBER:
        profile = [profile[0], (radius + thick, -thick), (radius + thick, thick)]
    profile.append(profile[0])
    count = len(profile) - 1
    builder.lathe(middle, profile, uniform(material, count, segments), segments=segments)
