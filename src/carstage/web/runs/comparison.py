"""Several runs beside each other, as the page shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path

from carstage.errors import CarStageError
from carstage.web.errors import WebError
from carstage.web.messages import (
    ComparedRun,
    LoadPoint,
    RunComparison,
    RunFiguresMessage,
    SettingDifference,
    TickPoint,
)
from carstage.web.messages.runs import MOST_COMPARED
from carstage.web.runs.follower import RunFollower
from carstage.web.runs.service import RunService
from carstage.web.wording import title_of


def compare_runs(runs: RunService, run_ids: Sequence[str]) -> RunComparison:
    """Figures and curves of each run, and the settings that differ.

    Args:
        runs: all runs.
        run_ids: which of them.

    Raises:
        WebError: there is no such run, or its events cannot be read.
    """
    from carstage.runs.comparing import differing_settings

    compared = [_compared(runs, run_id) for run_id in dict.fromkeys(run_ids)]
    try:
        configs = [runs.settings(one.run.run_id) for one in compared]
    except CarStageError as error:  # one has ended before it was planned
        return RunComparison(runs=compared, settings=[], note=error.message)
    settings = [
        SettingDifference(path=one.path, title=title_of(one.path), values=list(one.values))
        for one in differing_settings(configs)
    ]
    return RunComparison(runs=compared, settings=settings)


def _compared(runs: RunService, run_id: str) -> ComparedRun:
    from carstage.runs.comparing import run_figures

    summary = runs.summary(run_id)
    folder = runs.folder(run_id)
    if folder is None:
        return ComparedRun(run=summary)
    try:
        figures = run_figures(folder)
        events = folder / "events.jsonl"
        changed_ns = events.stat().st_mtime_ns if events.exists() else 0
    except OSError as error:
        message = f"The events of {run_id} cannot be read: {error.strerror}."
        raise WebError(409, message, "Look into its folder.") from error
    ticks, loads = _curves(folder, changed_ns)
    # The page knows more of a run that was started here: its name, and that it stops.
    figures_message = RunFiguresMessage.model_validate(asdict(figures) | {"name": summary.name})
    return ComparedRun(run=summary, figures=figures_message, ticks=ticks, loads=loads)


@lru_cache(maxsize=2 * MOST_COMPARED)
def _curves(folder: Path, _changed_ns: int) -> tuple[list[TickPoint], list[LoadPoint]]:
    """The whole of a run's points, kept by the time of its events."""
    follower = RunFollower(folder)
    while follower.read():
        pass
    return follower.ticks.after(0), follower.loads.after(0)
