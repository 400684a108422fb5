"""Reads the folders of runs, those that go on too: what they hold, and whether the run lives."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, open_regular, read_bounded
from carstage.files.json_text import parse_json
from carstage.runs.folder import FINAL_STATES, RESTED_S
from carstage.runs.identity import is_alive

Alive = Literal["running", "stalled", "dead", "ended"]
_MOST_READ_BYTES = 8 << 20


def read_document(path: Path) -> dict[str, Any] | None:
    """The JSON object in a file; None where there is none (yet)."""
    try:
        document = parse_json(read_bounded(path, LARGEST_DOCUMENT_BYTES))
    except (OSError, ValueError):
        return None
    return document if isinstance(document, dict) else None


def liveness(status: Mapping[str, Any], now_s: float | None = None) -> Alive:
    """Whether a run goes on, by its ``status.json``: process, its start time, heartbeat.

    ``stalled``: the process lives and has said nothing for longer than a commit may take.
    """
    if status.get("state") in FINAL_STATES:
        return "ended"
    if not is_alive(status):
        return "dead"
    return "running" if is_recent(status, now_s) else "stalled"


def is_recent(status: Mapping[str, Any], now_s: float | None = None) -> bool:
    """Whether the heartbeat is younger than a commit may take."""
    age_s = (time.time() if now_s is None else now_s) - _number(status.get("heartbeat"))
    return age_s <= RESTED_S


class EventTail:
    """Reads ``events.jsonl`` on from where it was; lines that are not whole yet wait.

    Args:
        path: the file; it need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rest = b""

    def read(self) -> list[dict[str, Any]]:
        """The events since the last call, at most some megabytes of them."""
        try:
            with os.fdopen(open_regular(self._path), "rb") as file:
                file.seek(self._offset)
                data = file.read(_MOST_READ_BYTES)
        except OSError:
            return []
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [event for line in lines if (event := parse_event(line)) is not None]


def parse_event(line: bytes) -> dict[str, Any] | None:
    """The content of a line of ``events.jsonl``; None for one that is not whole."""
    try:
        event = parse_json(line)
    except ValueError:
        return None  # a full disk may have left a line that is not whole
    return event if isinstance(event, dict) and isinstance(event.get("event"), str) else None


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else 0.0
