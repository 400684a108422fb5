"""Which box labels an actor: the server's, a measured one, or none.

Two-wheelers of stock CARLA report boxes of zero, infinite or 250 m size that leave the rider out
(carla#3670, #5321, #7596); walkers' boxes changed meaning between releases (#9335, #9729). A box
that cannot be right is never written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.classes import TWO_WHEELERS, WALKER_CLASSES
from carstage.geometry import FloatArray
from carstage.rawlog.reader import ActorInfo

MIN_HALF_SIZE_M: Final = 0.05
MAX_HALF_SIZE_M: Final = 15.0
MAX_OFFSET_M: Final = 15.0
MIN_TWO_WHEELER_HALF_WIDTH_M: Final = 0.15

MIN_LEVEL_HALF_SIZE_M: Final = 0.001
MAX_LEVEL_HALF_SIZE_M: Final = 500.0
"""Signs are thin plates, bridges and walls long."""

_CAPSULE_TOLERANCE_M: Final = 1e-3


@dataclass(frozen=True, slots=True)
class LabelBox:
    """The box that an actor is labelled with, in the actor's frame, a level object's in the world.

    Attributes:
        source: ``actor``, ``capsule``, ``mesh``, ``measured``, ``level`` or ``invalid``.
        location: ``(3,)`` centre (m).
        extent: ``(3,)`` half length, width, height (m).
        rotation_deg: ``(3,)`` pitch, yaw, roll.
    """

    source: str
    location: FloatArray
    extent: FloatArray
    rotation_deg: FloatArray

    @property
    def valid(self) -> bool:
        """Whether 3D labels may be made from it."""
        return self.source != "invalid"


@dataclass(frozen=True, slots=True)
class MeasuredBox:
    """A two-wheeler's box with its rider, measured from instance and depth pixels (m)."""

    location: tuple[float, float, float]
    extent: tuple[float, float, float]


# One entry per blueprint and measurement; empty until a server with unusable boxes is measured.
MEASURED_TWO_WHEELERS: Final[Mapping[str, MeasuredBox]] = MappingProxyType({})


def label_box(
    actor: ActorInfo,
    object_class: str,
    measured: Mapping[str, MeasuredBox] = MEASURED_TWO_WHEELERS,
) -> LabelBox:
    """The box to label an actor with.

    Args:
        actor: with the box that the server reports.
        object_class: from ``carstage.annotation.classes``.
        measured: boxes by blueprint that replace those of two-wheelers.
    """
    known = measured.get(actor.type_id) if object_class in TWO_WHEELERS else None
    if known is not None:
        return LabelBox(
            source="measured",
            location=np.array(known.location, dtype=np.float64),
            extent=np.array(known.extent, dtype=np.float64),
            rotation_deg=np.zeros(3),
        )
    if not box_is_plausible(actor, object_class):
        source = "invalid"
    elif object_class in WALKER_CLASSES:
        source = "capsule" if _is_capsule(actor) else "mesh"
    else:
        source = "actor"
    return LabelBox(source, actor.box_location, actor.box_extent, actor.box_rotation_deg)


def box_is_plausible(actor: ActorInfo, object_class: str) -> bool:
    """Whether every number of the server's box is finite and of a possible size."""
    extent, location = actor.box_extent, actor.box_location
    if not (np.isfinite(extent).all() and np.isfinite(location).all()):
        return False
    if not np.isfinite(actor.box_rotation_deg).all():
        return False
    if extent.min() < MIN_HALF_SIZE_M or extent.max() > MAX_HALF_SIZE_M:
        return False
    if object_class in TWO_WHEELERS and extent[1] < MIN_TWO_WHEELER_HALF_WIDTH_M:
        return False
    return bool(np.linalg.norm(location) <= MAX_OFFSET_M)


def are_plausible_in_level(
    location: FloatArray, extent: FloatArray, rotation_deg: FloatArray, parked: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which boxes of a level can be right; parked vehicles have the bounds of driving ones.

    Args:
        location: ``(N, 3)`` centres in the world (m).
        extent: ``(N, 3)`` half sizes (m).
        rotation_deg: ``(N, 3)`` pitch, yaw, roll.
        parked: ``(N,)`` which are of vehicles.
    """
    numbers = np.concatenate([location, extent, rotation_deg], axis=1)
    low = np.where(parked, MIN_HALF_SIZE_M, MIN_LEVEL_HALF_SIZE_M)
    high = np.where(parked, MAX_HALF_SIZE_M, MAX_LEVEL_HALF_SIZE_M)
    finite = np.isfinite(numbers).all(axis=1)
    return np.asarray(finite & (extent.min(axis=1) >= low) & (extent.max(axis=1) <= high))


def _is_capsule(actor: ActorInfo) -> bool:
    """Walkers up to 0.9.16: the collision capsule about the pivot, equal in x and y."""
    round_ = abs(actor.box_extent[0] - actor.box_extent[1]) <= _CAPSULE_TOLERANCE_M
    return bool(round_ and np.abs(actor.box_location).max() <= _CAPSULE_TOLERANCE_M)
