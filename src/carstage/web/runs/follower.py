"""Log lines, tick times and rate of one run, read on as its files grow."""

from __future__ import annotations

from collections import deque
from itertools import islice
from pathlib import Path
from typing import Any

from carstage.runs.reading import EventTail
from carstage.web.messages import LogLine, TickPoint
from carstage.web.runs.log import log_line

_MOST_LINES = 500
_MOST_TICKS = 3000
_RATE_OVER_S = 10.0


class RunFollower:
    """Follows the events of a run's folder; not safe to use from several threads.

    Everything has a number that only grows, so that many readers can each ask what is new to them.

    Args:
        folder: the run's.
    """

    def __init__(self, folder: Path) -> None:
        self._tail = EventTail(folder / "events.jsonl")
        self._lines: deque[LogLine] = deque(maxlen=_MOST_LINES)
        self._ticks: deque[TickPoint] = deque(maxlen=_MOST_TICKS)
        self.lines_seen = 0
        self.ticks_seen = 0
        self.committed: list[str] = []
        """Ids of the episodes that the run has committed."""
        self.retried: dict[str, str] = {}
        """Why an episode was begun once more, by its id."""

    def read(self) -> None:
        """Take in what was written since."""
        for event in self._tail.read():
            if event["event"] == "tick":
                self._tick(event)
                continue
            self._count(event)
            line = log_line(event)
            if line is not None:
                self._lines.append(line)
                self.lines_seen += 1

    def lines_after(self, seen: int) -> list[LogLine]:
        """The lines after the first ``seen`` ones, as far as they are kept."""
        return list(islice(self._lines, max(0, len(self._lines) - (self.lines_seen - seen)), None))

    def ticks_after(self, seen: int) -> list[TickPoint]:
        """The tick times after the first ``seen`` ones, as far as they are kept."""
        return list(islice(self._ticks, max(0, len(self._ticks) - (self.ticks_seen - seen)), None))

    def rate_ticks_s(self) -> float | None:
        """Steps per second of wall time over the last seconds; None before there are two."""
        if len(self._ticks) < 2:
            return None
        last = first = self._ticks[-1]
        for point in reversed(self._ticks):
            if point.tick > first.tick or last.time - point.time > _RATE_OVER_S:
                break  # another episode, or long ago
            first = point
        passed_s = last.time - first.time
        return (last.tick - first.tick) / passed_s if passed_s > 0 else None

    def _count(self, event: dict[str, Any]) -> None:
        episode = event.get("episode_id")
        if not isinstance(episode, str):
            return
        if event["event"] == "episode_committed":
            self.committed.append(episode)
        elif event["event"] == "episode_retried":
            self.retried[episode] = str(event.get("reason", ""))

    def _tick(self, event: dict[str, object]) -> None:
        time_s, tick = event.get("time"), event.get("tick")
        if not isinstance(time_s, int | float) or not isinstance(tick, int):
            return
        tick_s = None
        if self._ticks and tick > self._ticks[-1].tick:
            tick_s = (time_s - self._ticks[-1].time) / (tick - self._ticks[-1].tick)
        queued, waited = event.get("queued_bytes", 0), event.get("waited_s", 0.0)
        self._ticks.append(
            TickPoint(
                time=float(time_s),
                tick=tick,
                tick_s=tick_s,
                queued_bytes=queued if isinstance(queued, int) else 0,
                waited_s=float(waited) if isinstance(waited, int | float) else 0.0,
            )
        )
        self.ticks_seen += 1
