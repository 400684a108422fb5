"""The watched clock wakes a Traffic Manager that missed its cue, and only then."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from carstage_sim.check.ticking import WatchedClock

WAIT_S = 20.0


@dataclass
class Snapshot:
    frame: int


@dataclass
class Oversleeper:
    """World and Traffic Manager in one: its tick returns only after it was woken.

    Args:
        frame_comes: whether the new frame is seen before the wait, as in the real defect.
    """

    frame_comes: bool
    frame: int = 7
    woken: threading.Event = field(default_factory=threading.Event)
    modes: list[bool] = field(default_factory=list)

    def get_snapshot(self) -> Snapshot:
        return Snapshot(self.frame)

    def tick(self) -> int:
        if self.frame_comes:
            self.frame += 1
        self.woken.wait(1.0 if not self.frame_comes else WAIT_S)
        return self.frame

    def set_synchronous_mode(self, synchronous: bool) -> None:
        self.modes.append(synchronous)
        if not synchronous:
            self.woken.set()


def watched(sleeper: Oversleeper) -> WatchedClock:
    return WatchedClock(sleeper, sleeper, patience_s=0.1)


def test_a_missed_cue_is_made_up_for_and_synchronous_mode_stays() -> None:
    sleeper = Oversleeper(frame_comes=True)
    with watched(sleeper) as clock:
        assert clock.tick() == 8
        assert sleeper.woken.is_set()
        assert clock.wake_ups == 1
    assert sleeper.modes == [False, True]


def test_a_server_that_takes_long_for_a_frame_is_left_alone() -> None:
    sleeper = Oversleeper(frame_comes=False)
    with watched(sleeper) as clock:
        clock.tick()
        assert clock.wake_ups == 0
    assert sleeper.modes == []
