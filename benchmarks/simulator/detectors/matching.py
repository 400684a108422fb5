"""Which labelled objects a detector finds, and which of its boxes are off class.

Boxes are ``(N, 4)`` arrays of x0, y0, x1, y1 (px, half open).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.float32]

LEAST_IOU = 0.5
LEAST_SCORE = 0.3
LEAST_HEIGHT_PX = 32
LEAST_VISIBLE = 0.6
_TOUCHING_IOU = 0.1
"""A box that overlaps no object of its class by so much stands for none."""


@dataclass(frozen=True, slots=True)
class LabelledObject:
    """What stands in a picture.

    Attributes:
        group: by which recall is counted: car, large, two_wheeler, person, light.
        names: classes of the detector that name it.
        boxes: ``(N, 4)`` of which each will do: the two-wheeler's, its rider's, both's.
        judged: whether it is large and visible enough for recall.
        end_on: whether one looks on its front or rear rather than on its side.
        track_id: the same in all pictures of a place.
    """

    group: str
    names: frozenset[str]
    boxes: Boxes
    judged: bool = True
    end_on: bool = False
    track_id: int = 0


@dataclass(frozen=True, slots=True)
class FoundBox:
    """What a detector says."""

    name: str
    score: float
    box: Boxes


@dataclass(frozen=True, slots=True)
class Matching:
    """The outcome for one picture.

    Attributes:
        found: for each labelled object whether a box of its class fits.
        off_class: the boxes of which no object of their class stands near.
    """

    found: tuple[bool, ...]
    off_class: tuple[FoundBox, ...]


def overlaps(one: Boxes, others: Boxes) -> NDArray[np.float32]:
    """``(A, B)`` intersection over union of each pair."""
    low = np.maximum(one[:, None, :2], others[None, :, :2])
    high = np.minimum(one[:, None, 2:], others[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    areas = [
        np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0), axis=1) for boxes in (one, others)
    ]
    union = areas[0][:, None] + areas[1][None] - shared
    ratio: NDArray[np.float32] = (shared / np.maximum(union, 1e-6)).astype(np.float32)
    return ratio


def match(
    objects: Sequence[LabelledObject], boxes: Sequence[FoundBox], unjudged: frozenset[str]
) -> Matching:
    """Give each box to an object, the best box first.

    Args:
        objects: all that is labelled, however small: no box of theirs is off class.
        boxes: the detector's; those below :data:`LEAST_SCORE` are left out.
        unjudged: classes of things that stand in streets without a label.
    """
    found = [False] * len(objects)
    off_class: list[FoundBox] = []
    for box in sorted(boxes, key=lambda box: -box.score):
        if box.score < LEAST_SCORE:
            break
        fits = [
            float(overlaps(box.box[None], one.boxes).max()) if box.name in one.names else 0.0
            for one in objects
        ]
        free = [0.0 if found[k] else fit for k, fit in enumerate(fits)]
        if free and max(free) >= LEAST_IOU:
            found[free.index(max(free))] = True
        elif box.name not in unjudged and max(fits, default=0.0) < _TOUCHING_IOU:
            off_class.append(box)
    return Matching(tuple(found), tuple(off_class))


def is_end_on(observation_angle_rad: float) -> bool:
    """Whether a vehicle shows its front or rear: within 45 degrees of the line of sight.

    Args:
        observation_angle_rad: KITTI's alpha; 0 is a vehicle that heads to the right.
    """
    return abs(math.sin(observation_angle_rad)) >= math.sqrt(0.5)
