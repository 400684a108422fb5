"""What the numbers of the optical flow camera mean on this server.

Predicted from depth and poses for everything that stood still, and compared with the picture under
every reading that servers and documents are known to differ in: the signs of x and y, shares of
the whole or of half the image, motion since the last tick or until the next.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from carstage.geometry import FloatArray
from carstage.selftest.depth_view import DepthView
from carstage.selftest.verdict import Check

EXPECTED = "shares of half the image, x right, y up, since the tick before"
ACCEPTED_PX = 0.75
"""End-point error above which no reading counts as right (and half a step of the code)."""

_CODE_STEP = 1.0 / 512.0
_PAST, _FUTURE = -1, 1


def check_optical_flow(view: DepthView) -> Check:
    """The reading with the smallest median end-point error over the still pixels of all ticks."""
    height, width = view.depth_m.shape[1:]
    seen: dict[int, FloatArray] = {}
    wanted: dict[int, FloatArray] = {}
    for direction in (_PAST, _FUTURE):
        seen[direction], wanted[direction] = _samples(view, direction)
    errors = {}
    for right, up, half, direction in product((True, False), (True, False), (True, False), wanted):
        share = 0.5 if half else 1.0
        scale = np.array([width if right else -width, -height if up else height]) * share
        off_px = np.linalg.norm(seen[direction] * scale - wanted[direction], axis=-1)
        errors[_words(right=right, up=up, half=half, direction=direction)] = float(
            np.median(off_px)
        )
    found = min(errors, key=lambda words: errors[words])
    accepted_px = ACCEPTED_PX + 0.5 * _CODE_STEP * width / 2.0
    if not errors[found] <= accepted_px:
        return Check("optical flow", False, "no known reading", EXPECTED, errors[found], "px")
    return Check("optical flow", found == EXPECTED, found, EXPECTED, errors[found], "px")


def _samples(view: DepthView, direction: int) -> tuple[FloatArray, FloatArray]:
    """``(N, 2)`` values of the camera, and how far (px) the surfaces move in the image.

    Args:
        view: what the depth camera saw.
        direction: -1: since the tick before; 1: until the next one.
    """
    values, motions = [], []
    # Not the first tick, before which the rig stood elsewhere for another reason.
    for tick in range(1, view.evidence.ticks - 1):
        moved = view.warp(tick, tick + direction)
        here = moved.source[:, ::-1] + 0.5
        motions.append(direction * (moved.uv - here))
        picture = view.evidence.pictures["flow"][tick]
        values.append(picture[moved.source[:, 0], moved.source[:, 1]].astype(np.float64))
    return np.concatenate(values), np.concatenate(motions)


def _words(*, right: bool, up: bool, half: bool, direction: int) -> str:
    return ", ".join(
        (
            f"shares of {'half' if half else 'all'} the image",
            f"x {'right' if right else 'left'}",
            f"y {'up' if up else 'down'}",
            "since the tick before" if direction == _PAST else "until the next tick",
        )
    )
