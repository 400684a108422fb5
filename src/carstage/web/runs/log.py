"""Events of a run as lines of a log, in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from carstage.web.messages import LogLine
from carstage.web.messages.runs import Level
from carstage.web.wording import page_words

Event = Mapping[str, Any]

_SILENT = frozenset({"tick", "segment_sealed"})


def log_line(event: Event) -> LogLine | None:
    """The line for an event; None for those that come by the dozen a second."""
    name = str(event["event"])
    if name in _SILENT:
        return None
    level, words = _LINES.get(name, ("debug", _plain))
    try:
        text = words(event)
        if name == "run_finished" and event.get("state") != "done":
            level = "warning" if event.get("state") == "interrupted" else "error"
        time_s = float(event.get("time", 0.0))
    except (KeyError, TypeError, ValueError):
        text, time_s = _plain(event), 0.0  # written by another version
    return LogLine(time=time_s, level=level, event=name, text=text[:2000])


def _plain(event: Event) -> str:
    fields = ", ".join(f"{k} {v}" for k, v in event.items() if k not in ("time", "event"))
    return f"{str(event['event']).replace('_', ' ')}: {fields}" if fields else str(event["event"])


def _spawned(event: Event) -> str:
    spawned, requested = event.get("spawned"), event.get("requested")
    if isinstance(spawned, dict) and isinstance(requested, dict):
        parts = [f"{spawned.get(kind, 0)} of {count} {kind}" for kind, count in requested.items()]
        return f"Spawned {', '.join(parts)}."
    return f"Spawned {spawned}."


def _tested(event: Event) -> str:
    held = sum(bool(check["ok"]) for check in event["checks"])
    return f"Self-test of the server: {held} of {len(event['checks'])} checks hold."


def _finished(event: Event) -> str:
    committed = event.get("committed", 0)
    episodes = "1 episode" if committed == 1 else f"{committed} episodes"
    return f"The run is {event['state']}: {episodes} committed, {event.get('failed', 0)} failed."


def _recorded(event: Event) -> str:
    gaps = event.get("incomplete", 0)
    tail = f"; {gaps} ticks lack data of a sensor" if gaps else ""
    return f"Episode {event['episode_id']} is recorded: {event['ticks']} ticks{tail}."


_LINES: dict[str, tuple[Level, Callable[[Event], str]]] = {
    "run_started": ("info", lambda e: f"Run {e['run_id']} has begun."),
    "run_finished": ("info", _finished),
    "server_started": (
        "info",
        lambda e: f"The server ({e['kind']}) is up at {e['host']}:{e['port']}.",
    ),
    "server_stopped": ("debug", lambda e: f"The server has ended (status {e['exit_code']})."),
    "server_lost": ("warning", lambda e: f"The server ended while it started: {e['reason']}"),
    "server_tested": ("info", _tested),
    "collector_started": (
        "debug",
        lambda e: f"The collector runs with carla {e['client_version']}.",
    ),
    "connected": ("info", lambda e: f"Connected to CARLA {e['server_version']}, {e['map']}."),
    "episode_started": (
        "info",
        lambda e: f"Episode {e['episode_id']} ({e['attempt']}): {e['ticks']} ticks.",
    ),
    "actors_spawned": ("info", _spawned),
    "warm_up": ("debug", lambda e: f"Warm-up: {e['tick']} of {e['ticks']} ticks."),
    "episode_recorded": ("info", _recorded),
    "episode_aborted": (
        "warning",
        lambda e: f"Episode {e['episode_id']} was broken off: {e['reason']}",
    ),
    "error": (
        "error",
        lambda e: (
            f"{page_words(e['message'])} {page_words(e.get('hint') or '', hint=True)}".strip()
        ),
    ),
    "collector_finished": ("debug", lambda e: f"The collector has ended ({e['exit_code']})."),
    "attempt_reserved": ("debug", lambda e: f"Attempt {e['attempt']} of {e['episode_id']}."),
    "frames_converted": (
        "info",
        lambda e: f"{e['frames']} frames of episode {e['episode_id']} are converted.",
    ),
    "episode_committed": ("info", lambda e: f"Episode {e['episode_id']} is in the dataset."),
    "episode_skipped": (
        "info",
        lambda e: f"Episode {e['episode_id']} is skipped: {e['reason']}.",
    ),
    "episode_failed": (
        "error",
        lambda e: f"Episode {e['episode_id']} failed: {page_words(e['reason'])}",
    ),
    "episode_retried": (
        "warning",
        lambda e: f"Episode {e['episode_id']} is recorded again: {page_words(e['reason'])}",
    ),
}
