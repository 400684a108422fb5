"""Log lines, tick times, loads and rate of one run, read on as its files grow."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from itertools import islice
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import ValidationError

from carstage.runs.reading import EventTail
from carstage.web.messages import LoadPoint, LogLine, TickPoint
from carstage.web.runs.log import log_line

_MOST_LINES = 500
_MOST_POINTS = 3000
_GOLDEN = (5**0.5 - 1) / 2
_RATE_OVER_S = 10.0
_FRAMES_OVER_S = 1.0
_Point = TypeVar("_Point")


class Series(Generic[_Point]):
    """Points over a whole run: of a long one about every second, fourth, eighth … one is kept.

    Each has a number that only grows, so that readers can ask what is new to them. Which ones are
    kept follows the golden ratio: they lie evenly over the run, and what comes in turn, as the
    ticks of two workers, stays in its proportion.
    """

    def __init__(self) -> None:
        self._points: list[tuple[int, _Point]] = []
        self._share = 1.0
        self.seen = 0

    def append(self, point: _Point) -> None:
        """Take in a point."""
        self.seen += 1
        if self._keeps(self.seen):
            self._points.append((self.seen, point))
        if len(self._points) > _MOST_POINTS:
            self._share /= 2
            self._points = [one for one in self._points if self._keeps(one[0])]

    def _keeps(self, number: int) -> bool:
        return (number - 1) * _GOLDEN % 1.0 < self._share

    def after(self, seen: int) -> list[_Point]:
        """The points after the first ``seen`` ones, as far as they are kept."""
        first = bisect_right(self._points, seen, key=lambda numbered: numbered[0])
        return [point for _, point in self._points[first:]]


class _Pace:
    """What one worker's ticks were before."""

    def __init__(self) -> None:
        self.ticks: deque[tuple[float, int]] = deque(maxlen=2 * int(_RATE_OVER_S) * 10)
        self.frames: tuple[float, int] | None = None

    def tick_s(self, time_s: float, tick: int) -> float | None:
        """Wall seconds per step since the tick before."""
        if self.ticks and tick <= self.ticks[-1][1]:
            self.ticks.clear()  # another episode
            self.frames = None
        before = self.ticks[-1] if self.ticks else None
        self.ticks.append((time_s, tick))
        return None if before is None else (time_s - before[0]) / (tick - before[1])

    def frames_s(self, time_s: float, k: object) -> float | None:
        """Saved frames per second, once a second."""
        if not isinstance(k, int):
            return None  # this step is not saved
        before = self.frames
        if before is not None and time_s - before[0] < _FRAMES_OVER_S:
            return None
        self.frames = (time_s, k)
        return None if before is None else (k - before[1]) / (time_s - before[0])

    def rate_ticks_s(self, now_s: float) -> float | None:
        """Steps per second over the last seconds; None before there are two."""
        lately = [one for one in self.ticks if now_s - one[0] <= _RATE_OVER_S]
        if len(lately) < 2 or lately[-1][0] <= lately[0][0]:
            return None
        return (lately[-1][1] - lately[0][1]) / (lately[-1][0] - lately[0][0])


class RunFollower:
    """Follows the events of a run's folder; not safe to use from several threads.

    Everything has a number that only grows, so that many readers can each ask what is new to them.

    Args:
        folder: the run's.
    """

    def __init__(self, folder: Path) -> None:
        self._tail = EventTail(folder / "events.jsonl")
        self._lines: deque[LogLine] = deque(maxlen=_MOST_LINES)
        self.ticks: Series[TickPoint] = Series()
        self.loads: Series[LoadPoint] = Series()
        self._paces: dict[int, _Pace] = {}
        self.lines_seen = 0
        self.committed: list[str] = []
        """Ids of the episodes that the run has committed."""
        self.retried: dict[str, str] = {}
        """Why an episode was begun once more, by its id."""

    def read(self) -> bool:
        """Take in what was written since; whether there was something, and may be more."""
        events = self._tail.read()
        for event in events:
            if event["event"] == "tick":
                self._tick(event)
                continue
            if event["event"] == "load":
                self._load(event)
                continue
            self._count(event)
            line = log_line(event)
            if line is not None:
                self._lines.append(line)
                self.lines_seen += 1
        return bool(events)

    def lines_after(self, seen: int) -> list[LogLine]:
        """The lines after the first ``seen`` ones, as far as they are kept."""
        return list(islice(self._lines, max(0, len(self._lines) - (self.lines_seen - seen)), None))

    def rate_ticks_s(self) -> float | None:
        """Steps per second of wall time over the last seconds, of all workers together.

        None before a worker has made two.
        """
        last_s = max((pace.ticks[-1][0] for pace in self._paces.values()), default=0.0)
        rates = [pace.rate_ticks_s(last_s) for pace in self._paces.values()]
        known = [rate for rate in rates if rate is not None]
        return sum(known) if known else None

    def _count(self, event: dict[str, Any]) -> None:
        episode = event.get("episode_id")
        if not isinstance(episode, str):
            return
        if event["event"] == "episode_committed":
            self.committed.append(episode)
        elif event["event"] == "episode_retried":
            self.retried[episode] = str(event.get("reason", ""))

    def _tick(self, event: dict[str, Any]) -> None:
        time_s, tick = event.get("time"), event.get("tick")
        if not isinstance(time_s, int | float) or not isinstance(tick, int):
            return
        worker = _worker(event)
        pace = self._paces.setdefault(worker, _Pace())
        tick_s = pace.tick_s(float(time_s), tick)
        queued, waited = event.get("queued_bytes", 0), event.get("waited_s", 0.0)
        self.ticks.append(
            TickPoint(
                time=float(time_s),
                tick=tick,
                tick_s=tick_s,
                frames_s=pace.frames_s(float(time_s), event.get("k")),
                queued_bytes=queued if isinstance(queued, int) else 0,
                waited_s=float(waited) if isinstance(waited, int | float) else 0.0,
                worker=worker,
            )
        )

    def _load(self, event: dict[str, Any]) -> None:
        known = {key: event.get(key) for key in LoadPoint.model_fields}
        try:
            self.loads.append(LoadPoint.model_validate({**known, "worker": _worker(event)}))
        except ValidationError:
            return  # of another version


def _worker(event: dict[str, Any]) -> int:
    worker = event.get("worker", 0)
    return worker if isinstance(worker, int) else 0
