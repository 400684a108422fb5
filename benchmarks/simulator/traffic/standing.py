"""Who stands, and whether a red light is why."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.traffic.recording import GREEN, NO_LIGHT, FloatArray, Recording

STANDING_SPEED = 0.1  # m/s
STOOD_S = 60.0
QUEUE_GAP_M = 12.0
_QUEUE_ASIDE_M = 2.5
_LOOK_EVERY_S = 0.5


def longest_stand_s(recording: Recording) -> FloatArray:
    """``(N,)`` longest time (s) that each vehicle stood without a red light heading its queue.

    A stop goes on while the vehicle does not move; only the part of it counts in which no light
    that is red or yellow holds the vehicle itself or the first one of the queue that it stands in.
    """
    looks = recording.every(_LOOK_EVERY_S)
    elapsed_s = looks.step * recording.delta_s
    count = recording.speed.shape[1]
    stood, longest = np.zeros(count), np.zeros(count)
    for location, yaw_deg, speed, state in zip(
        recording.location[looks],
        recording.yaw_deg[looks],
        recording.speed[looks],
        recording.light_state[looks],
        strict=True,
    ):
        standing = speed < STANDING_SPEED
        held = (state != NO_LIGHT) & (state < GREEN)
        waits = queued(location, yaw_deg, recording.box_extent[:, 0], standing, standing & held)
        stood = np.where(standing, stood + np.where(waits, 0.0, elapsed_s), 0.0)
        longest = np.maximum(longest, stood)
    return longest


def queued(
    location: FloatArray,
    yaw_deg: FloatArray,
    half_length: FloatArray,
    standing: NDArray[np.bool_],
    heads: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Who stands in a queue behind one of the heads, themselves included.

    Args:
        location: ``(N, 3)``.
        yaw_deg, half_length, standing: ``(N,)``.
        heads: ``(N,)`` who is held by a light.
    """
    yaw = np.radians(yaw_deg)
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    offset = location[None, :, :2] - location[:, None, :2]
    ahead = np.einsum("ijk,ik->ij", offset, forward)
    aside = np.abs(offset[..., 1] * forward[:, None, 0] - offset[..., 0] * forward[:, None, 1])
    gap = ahead - half_length[:, None] - half_length[None, :]
    follows = (ahead > 0.0) & (gap < QUEUE_GAP_M) & (aside < _QUEUE_ASIDE_M)
    waits = heads
    while True:
        grown = waits | (standing & (follows & waits[None, :]).any(axis=1))
        if (grown == waits).all():
            return waits
        waits = grown
