"""What a run looks like while it goes on: bars on a terminal, plain lines elsewhere.

The bars are imported where there is a terminal: most of what that takes is for them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from datetime import timedelta

from carstage.cli.output import note
from carstage.runs import CurrentEpisode, events, size_text

_PLAIN_EVERY_S = 5.0
_STEPS_EVERY_S = 15.0


def sentences_of(event: events.RunEvent) -> Iterator[str]:
    """What the user should read of an event."""
    match event:
        case events.Notice(sentence):
            yield sentence
        case events.RunPlanned(estimate, todo, skipped):
            if skipped:
                yield f"{skipped} of {todo + skipped} episodes are in the dataset already."
            if todo:
                duration = timedelta(seconds=round(estimate.duration_s))
                yield (
                    f"{_count(todo, 'episode')} to record: about "
                    f"{size_text(estimate.dataset_bytes)} "
                    f"({size_text(estimate.peak_bytes)} at most on the way), "
                    f"{duration} on two cores."
                )
        case events.ServerStarted(kind, host, port):
            yield f"Server ({kind}) is up at {host}:{port}."
        case events.ServerTested(checks=checks):
            passed = sum(bool(check["ok"]) for check in checks)
            yield f"Self-test of the server: {passed} of {len(checks)} checks hold."
        case events.Connected(version, town):
            yield f"Connected to version {version}, {town}."
        case events.ActorsSpawned(requested=requested, spawned=spawned) if requested != spawned:
            yield f"Asked for {requested}, spawned {spawned}."
        case events.EpisodeCommitted(episode_id):
            yield f"Episode {episode_id} is in the dataset."
        case events.EpisodeFailed(episode_id):
            yield f"Episode {episode_id} failed."


class LineProgress:
    """A line now and then, for logs."""

    def __init__(
        self, write: Callable[[str], None], clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._write = write
        self._clock_s = clock_s
        self._next_s = 0.0
        self._over: set[str] = set()
        self._began: tuple[float, float] | None = None

    def __call__(self, event: events.RunEvent) -> None:
        """Write what an event says; of progress, a line if the last one is some seconds old."""
        for sentence in sentences_of(event):
            self._write(sentence)
        match event:
            case events.EpisodeCommitted() | events.EpisodeFailed() | events.EpisodeSkipped():
                self._over.add(event.episode_id)
            case events.AttemptReserved():
                self._over.discard(event.episode_id)
        if not isinstance(event, events.Progress):
            return
        current, now_s = event.current, self._clock_s()
        if current is None or now_s < self._next_s:
            return
        if current.episode_id in self._over and not event.workers:
            return  # it counts as one of those before
        self._next_s = now_s + _PLAIN_EVERY_S
        if event.workers:
            self._write(_line_of_workers(event))
            return
        counts = event.episodes
        number = counts.committed + counts.skipped + counts.failed + 1
        self._write(
            f"Episode {number} of {counts.total}: "
            f"recorded {_of(current.ticks_done, current.ticks_total)} steps, "
            f"converted {_of(current.frames_converted, current.frames_total)} frames"
            f"{_time_left(self._left_s(event, current, now_s))}."
        )

    def _left_s(
        self, event: events.Progress, current: CurrentEpisode, now_s: float
    ) -> float | None:
        """Seconds that the rest takes at the pace of the steps since the first line."""
        if not current.ticks_total:
            return None
        counts = event.episodes
        done = counts.committed + counts.failed + current.ticks_done / current.ticks_total
        if self._began is None:
            self._began = (now_s, done)
        began_s, before = self._began
        if done <= before:
            return None
        left = max(counts.total - counts.skipped - done, 0.0)
        return (now_s - began_s) * left / (done - before)


def _of(done: int, total: int) -> str:
    """A number of so many; the total may not be known."""
    return f"{done}/{total}" if total else str(done)


def _line_of_workers(progress: events.Progress) -> str:
    counts = progress.episodes
    parts = [f"{counts.committed + counts.skipped + counts.failed} of {counts.total} episodes"]
    for one in progress.workers:
        what: str = one.state
        if one.current is not None:
            steps = f"{one.current.ticks_done}/{one.current.ticks_total} steps"
            what = f"episode {one.current.index + 1}, {steps}"
        parts.append(f"worker {one.worker}: {what}")
    return "; ".join(parts) + _time_left(progress.eta_s) + "."


def _time_left(left_s: float | None) -> str:
    return "" if left_s is None else f"; about {timedelta(seconds=round(left_s))} left"


def watch_run() -> AbstractContextManager[events.OnEvent]:
    """Bars when stderr is a terminal, lines when it is not."""
    if sys.stderr.isatty():
        from rich.console import Console

        from carstage.cli.bars import BarProgress

        return BarProgress(Console(stderr=True))
    return nullcontext(LineProgress(note))


def watch_frames(what: str) -> AbstractContextManager[Callable[[int, int], None]]:
    """A bar for a command that goes through frames; nothing when stderr is no terminal."""
    if sys.stderr.isatty():
        from carstage.cli.bars import StepBar

        return StepBar(what, "frames")
    return nullcontext(lambda done, total: None)


@contextmanager
def watch_phases() -> Iterator[Callable[[str, int, int], None]]:
    """As ``watch_frames``, with a bar for each of several phases."""
    with ExitStack() as stack:
        bars: dict[str, Callable[[int, int], None]] = {}

        def show(phase: str, done: int, total: int) -> None:
            if phase not in bars:
                stack.close()  # the bar of the phase before
                bars[phase] = stack.enter_context(watch_frames(phase))
            bars[phase](done, total)

        yield show


def watch_steps(what: str, unit: str) -> AbstractContextManager[Callable[[int, int], None]]:
    """A bar for a long measurement; lines with the time left when stderr is no terminal."""
    if sys.stderr.isatty():
        from carstage.cli.bars import StepBar

        return StepBar(what, unit)
    return nullcontext(StepLines(what, note))


class StepLines:
    """A line now and then: how far it is, and how long the rest will take at this pace."""

    def __init__(
        self,
        what: str,
        write: Callable[[str], None],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._what = what
        self._write = write
        self._clock_s = clock_s
        self._begin: tuple[float, int] | None = None
        self._next_s = 0.0

    def __call__(self, done: int, total: int) -> None:
        """Take note; write a line if the last one is some seconds old."""
        now_s = self._clock_s()
        if self._begin is None:
            self._begin = (now_s, done)
        if now_s < self._next_s and done != total:
            return
        self._next_s = now_s + _STEPS_EVERY_S
        begin_s, begin_done = self._begin
        left = ""
        if begin_done < done < total:
            left_s = (now_s - begin_s) / (done - begin_done) * (total - done)
            left = f", {timedelta(seconds=round(left_s))} left"
        self._write(f"{self._what}: {done} of {total}{left}.")


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
