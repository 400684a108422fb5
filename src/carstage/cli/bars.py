"""Bars on a terminal: of a run, and of other work that takes long."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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

from carstage.cli.progress import sentences_of
from carstage.runs import CurrentEpisode, events


class _Rate(ProgressColumn):
    """Completed per second."""

    def render(self, task: Task) -> Text:
        """The column's text."""
        speed = task.finished_speed or task.speed
        unit = task.fields.get("unit", "")
        return Text(f"{speed:5.1f} {unit}/s" if speed and unit else "", style="dim")


class BarProgress:
    """Bars of episodes, recorded steps and converted frames, with rate and time left."""

    def __init__(self, console: Console) -> None:
        self._console = console
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

    def __call__(self, event: events.RunEvent) -> None:
        """Show an event of the run."""
        if isinstance(event, events.Progress):
            self._move(event)
        for sentence in sentences_of(event):
            self._console.print(sentence, highlight=False, markup=False)

    def _move(self, progress: events.Progress) -> None:
        counts = progress.episodes
        done = counts.committed + counts.skipped + counts.failed
        self._progress.update(self._episodes, total=counts.total, completed=done)
        current = progress.current
        if progress.workers:
            self._move_workers([one.current for one in progress.workers if one.current])
        if current is None or progress.workers:
            return
        if current.attempt + current.episode_id != self._shown:
            self._shown = current.attempt + current.episode_id
            for task in (self._steps, self._frames):
                self._progress.reset(task)
        steps = current.ticks_total or None  # not known beside a program that ends when it likes
        self._progress.update(self._steps, total=steps, completed=current.ticks_done)
        self._progress.update(
            self._frames, total=current.frames_total, completed=current.frames_converted
        )

    def _move_workers(self, shown: Sequence[CurrentEpisode]) -> None:
        """What all workers are at, in sum."""
        done, total = sum(one.ticks_done for one in shown), sum(one.ticks_total for one in shown)
        self._progress.update(self._steps, total=total, completed=done)
        done = sum(one.frames_converted for one in shown)
        total = sum(one.frames_total for one in shown)
        self._progress.update(self._frames, total=total, completed=done)


class StepBar:
    """One bar; entering it gives what moves it, with what is done and the total."""

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
