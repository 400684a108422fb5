"""One run in a few figures: state, progress, rate, time left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from carstage.web.messages import CurrentEpisodeMessage, EpisodeCountsMessage, RunSummary
from carstage.web.messages.runs import RunState
from carstage.web.runs.launches import Launch
from carstage.web.runs.records import RunPlan, RunRecord

_STATES = get_args(RunState)
_MOST_WORDS = 2000


def summary_of_launch(launch: Launch, position: int, *, alive: bool, tail: str) -> RunSummary:
    """A run without a folder: it waits, has just begun, or was refused before it made one.

    Args:
        launch: what was asked for.
        position: in the queue, from 1; 0 when it has begun.
        alive: whether its process lives.
        tail: the last lines of its command, where it ended.
    """
    out = Path(launch.out)
    ended = not launch.queued and not alive
    return RunSummary(
        run_id=launch.run_id,
        dataset=out.name,
        name=launch.name,
        state="queued" if launch.queued else "failed" if ended else "planning",
        alive="queued" if launch.queued else "ended" if ended else "running",
        position=position,
        stop=launch.stop,
        episodes=EpisodeCountsMessage(),
        message=_last_words(tail) if ended else None,
        started=None if launch.process is None else float(launch.process["pid_started"]),
    )


def summary_of_record(
    record: RunRecord, *, stop: int, rate_ticks_s: float | None, free_bytes: int
) -> RunSummary:
    """A run with a folder.

    Args:
        record: the contents of its folder.
        stop: how often it was asked to stop.
        rate_ticks_s: steps per second lately.
        free_bytes: free space where it writes.
    """
    status, plan = record.status, record.plan()
    counts = _counts(status)
    current = _current(status)
    done, total = _work(counts, current, plan)
    state = str(status.get("state"))
    over = record.alive in ("ended", "dead")
    heartbeat = status.get("heartbeat")
    return RunSummary(
        run_id=record.run_id,
        dataset=record.dataset,
        name=str(plan.config.get("name", "")) if plan else "",
        state=state if state in _STATES else "failed",  # type: ignore[arg-type]
        alive=record.alive,
        stop=stop,
        episodes=counts,
        current=current,
        message=_shortened(status.get("message")),
        progress=1.0 if state == "done" else min(1.0, done / total) if total else 0.0,
        rate_ticks_s=None if over else rate_ticks_s,
        eta_s=None if over else _time_left_s(status, counts, current, plan, rate_ticks_s),
        disk_free_bytes=free_bytes,
        started=_time(status.get("pid_started")),
        ended=_time(heartbeat) if over else None,
        sensors=list(plan.sensors) if plan else [],
    )


def _counts(status: Mapping[str, Any]) -> EpisodeCountsMessage:
    try:
        return EpisodeCountsMessage.model_validate(status.get("episodes"))
    except ValidationError:
        return EpisodeCountsMessage()


def _current(status: Mapping[str, Any]) -> CurrentEpisodeMessage | None:
    try:
        return CurrentEpisodeMessage.model_validate(status.get("current"))
    except ValidationError:
        return None


def _work(
    counts: EpisodeCountsMessage, current: CurrentEpisodeMessage | None, plan: RunPlan | None
) -> tuple[float, float]:
    """Ticks and frames that are done, and all of them; episodes are equally long."""
    if plan is None or not plan.episodes:
        return 0.0, 0.0
    total = float(plan.ticks + plan.frames)
    done = (counts.committed + counts.skipped + counts.failed) * total / plan.episodes
    if current is not None:
        done += current.ticks_done + current.frames_converted
    return done, total


def _time_left_s(
    status: Mapping[str, Any],
    counts: EpisodeCountsMessage,
    current: CurrentEpisodeMessage | None,
    plan: RunPlan | None,
    rate_ticks_s: float | None,
) -> float | None:
    """From the steps that are left and the rate lately; None before there is one.

    A run with several workers says it itself.
    """
    told = status.get("eta_s")
    if isinstance(told, int | float):
        return float(told)
    if plan is None or not plan.episodes or not rate_ticks_s:
        return None
    finished = counts.committed + counts.skipped + counts.failed
    ticks_done = finished * plan.ticks / plan.episodes
    ticks_done += current.ticks_done if current is not None else 0
    return max(0.0, plan.ticks - ticks_done) / rate_ticks_s


def _last_words(tail: str) -> str:
    """The error that a command ended with."""
    lines = [line for line in tail.splitlines() if line.strip()]
    for position in range(len(lines) - 1, -1, -1):
        if lines[position].startswith("Error: "):
            words = " ".join(lines[position:]).removeprefix("Error: ")
            return words[:_MOST_WORDS]
    return lines[-1][:_MOST_WORDS] if lines else "The run ended before it began."


def _shortened(message: Any) -> str | None:
    return str(message)[:_MOST_WORDS] if message else None


def _time(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None
