"""What a run looks like while it goes on: bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from carstage.cli.output import note
from carstage.plan import RunEstimate
from carstage.runs import RunObserver, RunStatus, size_text

_PLAIN_EVERY_S = 5.0
_STEPS_EVERY_S = 15.0


class _Rate(ProgressColumn):
    """Completed per second."""

    def render(self, task: Task) -> Text:
        """The column's text."""
        speed = task.finished_speed or task.speed
        unit = task.fields.get("unit", "")
        return Text(f"{speed:5.1f} {unit}/s" if speed and unit else "", style="dim")


class _Talking:
    """What both ways of showing share: sentences for events."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write

    def planned(self, estimate: RunEstimate, todo: int, skipped: int) -> None:
        """Say what is about to happen."""
        if skipped:
            self._write(f"{skipped} of {todo + skipped} episodes are in the dataset already.")
        if todo:
            duration = timedelta(seconds=round(estimate.duration_s))
            self._write(
                f"{_count(todo, 'episode')} to record: about {size_text(estimate.dataset_bytes)} "
                f"({size_text(estimate.peak_bytes)} at most on the way), {duration} on two cores."
            )

    def event(self, event: Mapping[str, Any]) -> None:
        """Say the events that a user cares for."""
        name = event["event"]
        if name == "server_started":
            self._write(f"Server ({event['kind']}) is up at {event['host']}:{event['port']}.")
        elif name == "server_tested":
            held = sum(bool(check["ok"]) for check in event["checks"])
            self._write(f"Self-test of the server: {held} of {len(event['checks'])} checks hold.")
        elif name == "connected":
            self._write(f"Connected to version {event.get('server_version')}, {event.get('map')}.")
        elif name == "actors_spawned" and event.get("requested") != event.get("spawned"):
            self._write(f"Asked for {event.get('requested')}, spawned {event.get('spawned')}.")
        elif name == "episode_committed":
            self._write(f"Episode {event['episode_id']} is in the dataset.")
        elif name == "episode_failed":
            self._write(f"Episode {event['episode_id']} failed.")

    def notify(self, sentence: str) -> None:
        """Say it."""
        self._write(sentence)


class BarProgress(_Talking):
    """Bars of episodes, recorded steps and converted frames, with rate and time left."""

    def __init__(self, console: Console) -> None:
        super().__init__(lambda text: console.print(text, highlight=False, markup=False))
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            _Rate(),
            TimeRemainingColumn(),
            console=console,
            expand=True,
        )
        self._episodes = self._progress.add_task("Episodes", total=None)
        self._steps = self._progress.add_task("Recording", total=None, unit="steps")
        self._frames = self._progress.add_task("Conversion", total=None, unit="frames")
        self._shown: str | None = None

    def __enter__(self) -> BarProgress:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def status(self, status: RunStatus) -> None:
        """Move the bars."""
        counts = status.episodes
        done = counts.committed + counts.skipped + counts.failed
        self._progress.update(self._episodes, total=counts.total, completed=done)
        current = status.current
        if current is None:
            return
        if current.attempt + current.episode_id != self._shown:
            self._shown = current.attempt + current.episode_id
            for task in (self._steps, self._frames):
                self._progress.reset(task)
        self._progress.update(self._steps, total=current.ticks_total, completed=current.ticks_done)
        self._progress.update(
            self._frames, total=current.frames_total, completed=current.frames_converted
        )


class LineProgress(_Talking):
    """A line now and then, for logs."""

    def __init__(
        self, write: Callable[[str], None], clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(write)
        self._clock_s = clock_s
        self._next_s = 0.0

    def status(self, status: RunStatus) -> None:
        """Write a line if the last one is some seconds old and something goes on."""
        current, now_s = status.current, self._clock_s()
        if current is None or now_s < self._next_s:
            return
        self._next_s = now_s + _PLAIN_EVERY_S
        self._write(
            f"Episode {current.index + 1} of {status.episodes.total}: "
            f"recorded {current.ticks_done}/{current.ticks_total} steps, "
            f"converted {current.frames_converted}/{current.frames_total} frames."
        )


def watch_run() -> AbstractContextManager[RunObserver]:
    """Bars when stderr is a terminal, lines when it is not."""
    if sys.stderr.isatty():
        return BarProgress(Console(stderr=True))
    return nullcontext(LineProgress(note))


def watch_frames(what: str) -> AbstractContextManager[Callable[[int, int], None]]:
    """A bar for a command that goes through frames; nothing when stderr is no terminal."""
    if sys.stderr.isatty():
        return _StepBar(what, "frames")
    return nullcontext(lambda done, total: None)


def watch_steps(what: str, unit: str) -> AbstractContextManager[Callable[[int, int], None]]:
    """A bar for a long measurement; lines with the time left when stderr is no terminal."""
    if sys.stderr.isatty():
        return _StepBar(what, unit)
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


class _StepBar:
    def __init__(self, what: str, unit: str) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            _Rate(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            expand=True,
            transient=True,
        )
        self._task = self._progress.add_task(what, total=None, unit=unit)

    def __enter__(self) -> Callable[[int, int], None]:
        self._progress.start()
        return lambda done, total: self._progress.update(self._task, total=total, completed=done)

    def __exit__(self, *_: object) -> None:
        self._progress.stop()


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
