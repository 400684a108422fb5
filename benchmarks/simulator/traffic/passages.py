"""Passages of stop lines, and under which state of the light each was begun.

A stop line is where the light's signal holds: on the painted line, or else where the lane enters
the junction.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.traffic.recording import RED, Recording
from benchmarks.simulator.traffic.standing import STANDING_SPEED

_MAX_TURN_DEG = 60.0
_MAX_RISE_M = 3.0
_JUMP_M = 5.0


@dataclass(frozen=True, slots=True)
class Passage:
    """A vehicle's centre went over a stop line.

    Attributes:
        vehicle, signal: their rows.
        tick: when the centre crossed.
        entered: when the front bumper crossed, or when the vehicle last set off after that.
        state: of the light at that tick.
    """

    vehicle: int
    signal: int
    tick: int
    entered: int
    state: int


def passages(recording: Recording) -> list[Passage]:
    """All passages, by stop line, then vehicle, then time."""
    found = []
    for line in range(len(recording.stop_signal)):
        ahead = _ahead_m(recording, line)
        crossed = (ahead[:-1] < 0.0) & (ahead[1:] >= 0.0) & (ahead[1:] - ahead[:-1] < _JUMP_M)
        for vehicle, tick in np.argwhere(crossed.T).tolist():
            found.append(_passage(recording, line, vehicle, tick + 1, ahead[:, vehicle]))
    return found


def red_lights_run(driven: Iterable[Passage]) -> list[Passage]:
    """Of some passages, those that began under red."""
    return [passage for passage in driven if passage.state == RED]


def _ahead_m(recording: Recording, line: int) -> NDArray[np.float64]:
    """``(T, N)`` metres that vehicles on the line's lane are past it; NaN for all others."""
    x, y, z, yaw_deg = recording.stop_pose[line].tolist()
    forward = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
    offset = recording.location - np.array([x, y, z])
    ahead = offset[..., :2] @ forward
    aside = offset[..., 1] * forward[0] - offset[..., 0] * forward[1]
    turned = np.abs((recording.yaw_deg - yaw_deg + 180.0) % 360.0 - 180.0)
    on_lane = (
        (np.abs(aside) <= recording.stop_width_m[line] / 2.0)
        & (turned < _MAX_TURN_DEG)
        & (np.abs(offset[..., 2]) < _MAX_RISE_M)
    )
    return np.asarray(np.where(on_lane, ahead, np.nan))


def _passage(
    recording: Recording, line: int, vehicle: int, tick: int, ahead: NDArray[np.float64]
) -> Passage:
    front = float(recording.box_center[vehicle, 0] + recording.box_extent[vehicle, 0])
    entered = tick
    while entered > 0 and ahead[entered - 1] + front >= 0.0:
        if recording.speed[entered - 1, vehicle] < STANDING_SPEED:
            break
        entered -= 1
    signal = int(recording.stop_signal[line])
    state = int(recording.signal_state[entered, signal])
    return Passage(vehicle, signal, tick, entered, state)
