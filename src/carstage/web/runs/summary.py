"""One run in a few figures: state, progress, rate, time left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import ValidationError

from carstage.web.messages import (
    CurrentEpisodeMessage,
    EpisodeCountsMessage,
    RunSummary,
    WorkerMessage,
)
from carstage.web.messages.runs import RunState
from carstage.web.runs.launches import Launch
from carstage.web.runs.records import RunPlan, RunRecord
from carstage.web.wording import page_words

_STATES = get_args(RunState)
_MOST_WORDS = 2000


def summary_of_launch(
    launch: Launch, dataset: str, position: int, *, alive: bool, tail: str, ended_s: float | None
) -> RunSummary:
    """A run without a folder: it waits, has just begun, or was refused before it made one.

    Args:
        launch: what was asked for.
        dataset: id of its dataset.
        position: in the queue, from 1; 0 when it has begun.
        alive: whether its process lives.
        tail: the last lines of its command, where it ended.
        ended_s: when it ended, Unix time.
    """
    ended = not launch.queued and not alive
    return RunSummary(
        run_id=launch.run_id,
        dataset=dataset,
        name=launch.name,
        state="queued" if launch.queued else "failed" if ended else "planning",
        alive="queued" if launch.queued else "ended" if ended else "running",
        position=position,
        stop=launch.stop,
        episodes=EpisodeCountsMessage(),
        message=_last_words(tail) if ended else None,
        started=None if launch.process is None else float(launch.process["pid_started"]),
        ended=ended_s if ended else None,
        location=launch.out,
        continues=launch.continues,
        resumable=ended,
    )


@dataclass(frozen=True, slots=True)
class Seen:
    """What is known of a run besides its folder's documents.

    Attributes:
        launch: how it was asked for; None: by somebody else.
        stop: how often it was asked to stop.
        rate_ticks_s: steps per second lately.
        free_bytes: free space where it writes.
        retried: why episodes were begun once more, by id.
        progress: the furthest that it was seen; between two episodes less is known.
    """

    launch: Launch | None
    stop: int
    rate_ticks_s: float | None
    free_bytes: int
    retried: Mapping[str, str]
    progress: float


def summary_of_record(record: RunRecord, seen: Seen) -> RunSummary:
    """A run with a folder.

    Args:
        record: the contents of its folder.
        seen: what else is known.
    """
    launch, rate_ticks_s = seen.launch, seen.rate_ticks_s
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
        name=record.label() or (str(plan.config.get("name", "")) if plan else "") or _named(launch),
        state=state if state in _STATES else "failed",  # type: ignore[arg-type]
        alive=record.alive,
        stop=seen.stop,
        episodes=counts,
        current=current,
        message=_shortened(status.get("message")),
        progress=1.0
        if state == "done"
        else max(seen.progress, min(1.0, done / total))
        if total
        else 0.0,
        rate_ticks_s=None if over else rate_ticks_s,
        mean_ticks_s=_mean_rate(status, counts, plan) if over else None,
        eta_s=None if over else _time_left_s(status, counts, current, plan, rate_ticks_s),
        disk_free_bytes=seen.free_bytes,
        started=_time(status.get("pid_started")),
        ended=_time(heartbeat) if over else None,
        sensors=list(plan.sensors) if plan else [],
        location=str(record.out),
        folder=str(record.folder),
        continues=launch.continues if launch else None,
        resumable=over and (state != "done" or counts.failed > 0) and (plan or launch) is not None,
        again=_again(current, seen.retried),
        workers=_workers(status),
        driven=plan.driven if plan else None,
    )


def _mean_rate(
    status: Mapping[str, Any], counts: EpisodeCountsMessage, plan: RunPlan | None
) -> float | None:
    """Steps of committed episodes per second between the run's begin and its last word."""
    started, last = _time(status.get("pid_started")), _time(status.get("heartbeat"))
    if plan is None or not plan.episodes or started is None or last is None or last <= started:
        return None
    return counts.committed * plan.ticks / plan.episodes / (last - started)


def _named(launch: Launch | None) -> str:
    return "" if launch is None else launch.name


def _again(current: CurrentEpisodeMessage | None, retried: Mapping[str, str]) -> str | None:
    """Why the episode under way is not at its first attempt in this run."""
    if current is None or current.episode_id not in retried:
        return None
    return _shortened(retried[current.episode_id]) or "The attempt before has failed."


def _workers(status: Mapping[str, Any]) -> list[WorkerMessage]:
    listed = status.get("workers")
    found = []
    for worker in listed if isinstance(listed, list) else ():
        try:
            known = {key: worker.get(key) for key in ("worker", "state", "current")}
            found.append(WorkerMessage.model_validate(known))
        except (ValidationError, AttributeError):
            continue  # of another version
    return found


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
            return page_words(words)[:_MOST_WORDS]
    return lines[-1][:_MOST_WORDS] if lines else "The run ended before it began."


def _shortened(message: Any) -> str | None:
    return page_words(str(message))[:_MOST_WORDS] if message else None


def _time(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None
