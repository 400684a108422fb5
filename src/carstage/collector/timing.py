"""Time: synchronous stepping with sub-steps, asynchronous following, what is saved and sealed."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from contextlib import ExitStack
from typing import Any, Dict, Iterable, Iterator, NamedTuple, Optional, Type

from carstage.collector.internals.errors import RecordingError
from carstage.collector.internals.traffic_manager_wakeup import TickWatch
from carstage.spec import EpisodeSpec, TimingSpec

MAX_SEGMENT_BYTES = 256 * 1024 * 1024
SKIP_PATIENCE_S = 1.0


class Tick(NamedTuple):
    """One step of the world: ``tick_s`` is the wall time that it took.

    ``snapshot`` is None where the server went on and its state never came.
    """

    frame: int
    timestamp_s: float
    tick_s: float
    snapshot: Any


def skipped_ticks(last: Optional[Tick], step: Tick) -> Iterator[Tick]:
    """The frames between two steps that we saw nothing of; their times are interpolated."""
    if last is None:
        return
    between = step.frame - last.frame
    for number in range(1, between):
        share = number / between
        time_s = last.timestamp_s + share * (step.timestamp_s - last.timestamp_s)
        yield Tick(last.frame + number, time_s, 0.0, None)


def ticks_per_segment(fps: float, bytes_per_tick: Iterable[int]) -> int:
    """One simulated second, at least one tick, at most 256 MiB of the largest stream."""
    largest = max(bytes_per_tick, default=1)
    return max(1, min(round(fps), MAX_SEGMENT_BYTES // max(1, largest)))


def patience_s(timing: TimingSpec, timeout_s: float) -> float:
    """How long an incomplete frame is waited for."""
    return min(SKIP_PATIENCE_S, timeout_s) if not timing.demands_all else timeout_s


def take_clock(world: Any, spec: EpisodeSpec) -> None:
    """Make the server run as planned, and be the one for whom it does.

    Settings that are as planned are sent all the same: a client that died may have made them, and
    a server may set its world free in a moment.
    """
    world.apply_settings(_planned(world, spec))


def keep_clock(world: Any, spec: EpisodeSpec) -> None:
    """Make the server run as planned again; one that does already is left alone."""
    if not keeps_timing(world, spec):
        world.apply_settings(_planned(world, spec))


def keeps_timing(world: Any, spec: EpisodeSpec) -> bool:
    """Whether the server still runs as ``take_clock`` has made it."""
    return bool(world.get_settings() == _planned(world, spec))


def _planned(world: Any, spec: EpisodeSpec) -> Any:
    settings = world.get_settings()
    settings.synchronous_mode = spec.timing.synchronous
    settings.no_rendering_mode = False
    settings.fixed_delta_seconds = spec.step_s
    settings.substepping = True
    settings.max_substep_delta_time = spec.timing.max_substep_delta_time_s
    settings.max_substeps = spec.timing.max_substeps
    return settings


def release_timing(world: Any, original: Any) -> None:
    """Give the server's clock back: asynchronous, its other settings as they were found."""
    original.synchronous_mode = False
    original.fixed_delta_seconds = None
    world.apply_settings(original)


class Clock(ABC):
    """Brings the world from one tick to the next.

    Args:
        world: ``carla.World``.
        timeout_s: how long one step may take.
        watch: frees a tick that is stuck behind the client's own Traffic Manager.
    """

    def __init__(self, world: Any, timeout_s: float, watch: Optional[TickWatch] = None) -> None:
        self._world = world
        self._timeout_s = timeout_s
        self._watch = watch

    @abstractmethod
    def step(self) -> Tick:
        """Make or await the next tick.

        Raises:
            RecordingError: the server's state is not the one of that tick, or the Traffic Manager
                may have driven one step more.
            RuntimeError: the server did not answer in time.
        """


class SynchronousClock(Clock):
    """We tick; the state that is read next is the state of that tick."""

    def step(self) -> Tick:
        """Tick once; the snapshot must carry the frame that the tick returned."""
        begin_s = time.perf_counter()
        with ExitStack() as watched:
            if self._watch is not None:
                watched.enter_context(self._watch.over_a_tick())
            frame = self._world.tick(self._timeout_s)
        tick_s = time.perf_counter() - begin_s
        if self._watch is not None and self._watch.changed:
            raise RecordingError(
                "The Traffic Manager missed its cue before frame %d and had to be woken, which may "
                "have made it drive one step more." % frame,
                "Nothing is wrong with the configuration; a less busy machine has this less often.",
            )
        snapshot = self._world.get_snapshot()
        if snapshot.frame != frame:
            raise RecordingError(
                "The server ticked to frame %d, but its state is of frame %d."
                % (frame, snapshot.frame),
                "Make sure that nobody else ticks this server.",
            )
        return Tick(frame, snapshot.timestamp.elapsed_seconds, tick_s, snapshot)


class AsynchronousClock(Clock):
    """The server runs on its own; we take each state that reaches us, gaps included."""

    def step(self) -> Tick:
        """Wait for the next state."""
        begin_s = time.perf_counter()
        snapshot = self._world.wait_for_tick(self._timeout_s)
        tick_s = time.perf_counter() - begin_s
        return Tick(snapshot.frame, snapshot.timestamp.elapsed_seconds, tick_s, snapshot)


CLOCKS: Dict[bool, Type[Clock]] = {True: SynchronousClock, False: AsynchronousClock}
"""Synchronous or not, to the clock."""
