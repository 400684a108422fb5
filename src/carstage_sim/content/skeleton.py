"""The bones of a pedestrian, with CARLA's names, over the joints of a figure.

CARLA's walkers have one skeleton; its bones are those that ``PythonAPI/examples/draw_skeleton.py``
draws. A bone's x axis points along the limb. Component space has its origin between the feet and
the actor's axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from carstage_sim.content.heads import eye_at
from carstage_sim.content.lofting import Array
from carstage_sim.content.posing import Pose
from carstage_sim.content.walking import head_size, size_m

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
_PHALANGES = ("", "01", "02", "End")
_HEAD_JOINT_M = 0.09
"""How far the head's joint is below the middle of the head, for a figure of 1.8 m."""
_TOE_SHARE = 0.7


@dataclass(frozen=True, slots=True)
class Bone:
    """A bone and the one that carries it; the root has none."""

    name: str
    parent: str | None


def _arm(side: str) -> list[Bone]:
    hand = f"crl_hand__{side}"
    bones = [
        Bone(f"crl_shoulder__{side}", "crl_spine01__C"),
        Bone(f"crl_arm__{side}", f"crl_shoulder__{side}"),
        Bone(f"crl_foreArm__{side}", f"crl_arm__{side}"),
        Bone(hand, f"crl_foreArm__{side}"),
    ]
    for finger in _FINGERS:
        parent = hand
        for phalanx in _PHALANGES:
            name = f"crl_hand{finger}{phalanx}__{side}"
            bones.append(Bone(name, parent))
            parent = name
    return bones


def _leg(side: str) -> list[Bone]:
    names = [f"crl_{part}__{side}" for part in ("thigh", "leg", "foot", "toe", "toeEnd")]
    return [
        Bone(name, parent) for name, parent in zip(names, ["crl_hips__C", *names], strict=False)
    ]


BONES: tuple[Bone, ...] = (
    Bone("crl_root", None),
    Bone("crl_hips__C", "crl_root"),
    Bone("crl_spine__C", "crl_hips__C"),
    Bone("crl_spine01__C", "crl_spine__C"),
    *_arm("L"),
    Bone("crl_neck__C", "crl_spine01__C"),
    Bone("crl_Head__C", "crl_neck__C"),
    Bone("crl_eye__L", "crl_Head__C"),
    Bone("crl_eye__R", "crl_Head__C"),
    *_arm("R"),
    *_leg("R"),
    *_leg("L"),
)
"""All bones, parents before children."""

Transforms = dict[str, Array]
"""``(4, 4)`` poses by the bones' names."""


def component_from_bones(joints: Pose, half_height_m: float) -> Transforms:
    """Poses of all bones in component space.

    Args:
        joints: of a figure whose origin is at mid height.
        half_height_m: of the figure's box.
    """
    unit = half_height_m / 0.9
    up, ahead = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    lift = up * half_height_m
    trunk = joints.neck - joints.pelvis
    neck_up = (joints.head - joints.neck) / np.linalg.norm(joints.head - joints.neck)
    eye_x, eye_y, eye_z = unit * eye_at(head_size(size_m((0.0, 0.0, half_height_m))))
    head = joints.head - neck_up * _HEAD_JOINT_M * unit
    found: Transforms = {"crl_root": np.eye(4)}

    def put(name: str, place: Array, along: Array, side: Array) -> None:
        found[name] = _aimed(place + lift, along, side)

    put("crl_hips__C", joints.pelvis, trunk, ahead)
    put("crl_spine__C", joints.pelvis + 0.2 * trunk, trunk, ahead)
    put("crl_spine01__C", joints.pelvis + 0.48 * trunk, trunk, ahead)
    put("crl_neck__C", joints.neck, joints.head - joints.neck, ahead)
    put("crl_Head__C", head, neck_up, ahead)
    for index, side in enumerate("LR"):
        outward = np.array([0.0, -1.0 if side == "L" else 1.0, 0.0])
        eye = joints.head + eye_x * ahead + eye_y * outward + eye_z * up
        put(f"crl_eye__{side}", eye, ahead, up)
        shoulder, elbow, hand = (
            limb[index] for limb in (joints.shoulder, joints.elbow, joints.hand)
        )
        collar = joints.neck + 0.2 * (shoulder - joints.neck)
        put(f"crl_shoulder__{side}", collar, shoulder - collar, ahead)
        put(f"crl_arm__{side}", shoulder, elbow - shoulder, ahead)
        put(f"crl_foreArm__{side}", elbow, hand - elbow, ahead)
        along = (hand - elbow) / np.linalg.norm(hand - elbow)
        put(f"crl_hand__{side}", hand, along, ahead)
        for number, finger in enumerate(_FINGERS):
            start = 0.03 if finger == "Thumb" else 0.08
            spread = ahead * (0.04 - 0.02 * number)
            for knuckle, phalanx in enumerate(_PHALANGES):
                place = hand + (along * (start + 0.025 * knuckle) + spread) * unit
                put(f"crl_hand{finger}{phalanx}__{side}", place, along, ahead)
        hip, knee, ankle, toe = (
            limb[index] for limb in (joints.hip, joints.knee, joints.ankle, joints.toe)
        )
        put(f"crl_thigh__{side}", hip, knee - hip, ahead)
        put(f"crl_leg__{side}", knee, ankle - knee, ahead)
        put(f"crl_foot__{side}", ankle, toe - ankle, up)
        put(f"crl_toe__{side}", ankle + _TOE_SHARE * (toe - ankle), toe - ankle, up)
        put(f"crl_toeEnd__{side}", toe, toe - ankle, up)
    return found


def joints_of(component_from_bone: Mapping[str, Array], half_height_m: float) -> Pose:
    """The joints that a figure needs, from the poses of its bones."""
    lift = np.array([0.0, 0.0, half_height_m])

    def at(name: str) -> Array:
        place: Array = component_from_bone[f"crl_{name}"][:3, 3] - lift
        return place

    def pair(name: str) -> tuple[Array, Array]:
        return at(f"{name}__L"), at(f"{name}__R")

    head_up = component_from_bone["crl_Head__C"][:3, 0] * _HEAD_JOINT_M * half_height_m / 0.9
    return Pose(
        pelvis=at("hips__C"),
        neck=at("neck__C"),
        head=at("Head__C") + head_up,
        shoulder=pair("arm"),
        elbow=pair("foreArm"),
        hand=pair("hand"),
        hip=pair("thigh"),
        knee=pair("leg"),
        ankle=pair("foot"),
        toe=pair("toeEnd"),
    )


def relative_transforms(component_from_bone: Mapping[str, Array]) -> Transforms:
    """Poses of all bones in their parents' frames; the root's in component space."""
    return {
        bone.name: component_from_bone[bone.name]
        if bone.parent is None
        else np.linalg.inv(component_from_bone[bone.parent]) @ component_from_bone[bone.name]
        for bone in BONES
    }


def component_transforms(parent_from_bone: Mapping[str, Array]) -> Transforms:
    """The inverse of :func:`relative_transforms`."""
    found: Transforms = {}
    for bone in BONES:
        relative = parent_from_bone[bone.name]
        found[bone.name] = relative if bone.parent is None else found[bone.parent] @ relative
    return found


def _aimed(place: Array, along: Array, side: Array) -> Array:
    """A pose at a place whose x axis is ``along`` and whose y axis is close to ``side``."""
    x = along / np.linalg.norm(along)
    y = side - (side @ x) * x
    y = y / np.linalg.norm(y)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    matrix[:3, 3] = place
    return matrix
