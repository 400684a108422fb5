"""What a run writes down about itself: events, status with heartbeat; and who hears of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

from carstage.errors import StorageError
from carstage.runs.events import Notice, OnEvent, Progress, RunEvent, event_of
from carstage.runs.folder import EpisodeCounts, RunFolder, RunStatus, State
from carstage.runs.interruption import ANSWER_S, Interruption
from carstage.runs.load import LOAD_EVERY_S, LoadMeter

_HEARTBEAT_S = 1.0
_EXPLAIN_AFTER_S = 5.0


class RunRecord:
    """Status and events of a run, in its folder and for ``on_event``.

    Args:
        folder: the run's.
        interruption: its signals; none of them tears a line.
        on_event: called with every event, progress and notice.
    """

    def __init__(
        self,
        folder: RunFolder,
        interruption: Interruption,
        on_event: OnEvent | None = None,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder = folder
        self.status = RunStatus(
            run_id=folder.run_id,
            state="planning",
            process=folder.process,
            heartbeat=0.0,
            episodes=EpisodeCounts(),
        )
        self._interruption = interruption
        self._on_event = on_event
        self._clock_s = clock_s
        self._next_heartbeat_s = 0.0
        self._meter = LoadMeter(folder.work)
        self._next_load_s = clock_s() + LOAD_EVERY_S

    def left_s(self) -> float:
        """Seconds for which what goes on may be waited for; infinite before a signal."""
        return self._interruption.left_before_s(ANSWER_S)

    def event(self, event: RunEvent) -> None:
        """Write an event of the run itself."""
        self._write(event.to_line(), event)

    def copy_event(self, line: Mapping[str, Any]) -> None:
        """Write an event of the collector as it came, and follow its ticks."""
        current = self.status.current
        if (
            line["event"] == "tick"
            and current is not None
            and line["episode_id"] == current.episode_id
        ):
            current.ticks_done = int(line["tick"]) + 1
        self._write(line, None)

    def notice(self, sentence: str) -> None:
        """Pass on something that the user should read."""
        if self._on_event is not None:
            self._on_event(Notice(sentence))

    def enter(self, state: State) -> None:
        """Write down that the run is in this state now."""
        self.status.state = state
        with self._interruption.deferred():
            self.folder.write_status(self.status, durable=True)
        self._show()

    def beat(self) -> None:
        """Renew the heartbeat and note the load where that is due; pass on how far the run is."""
        now_s = self._clock_s()
        if now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = now_s + _HEARTBEAT_S
            self.folder.write_status(self.status)
        if now_s >= self._next_load_s:
            self._next_load_s = now_s + LOAD_EVERY_S
            self.event(self._meter.sample())
        self._show()

    @contextmanager
    def waiting(self, what: str) -> Iterator[None]:
        """Keep the heartbeat while the caller waits; explain by ``what`` when it takes long."""
        over = threading.Event()

        def beat() -> None:
            begin_s = self._clock_s()
            explained = False
            while not over.wait(_HEARTBEAT_S):
                with suppress(StorageError):  # raised where the run itself writes next
                    self.folder.write_status(self.status)
                if not explained and self._clock_s() - begin_s > _EXPLAIN_AFTER_S:
                    explained = True
                    self.notice(what)

        thread = threading.Thread(target=beat, name="heartbeat", daemon=True)
        thread.start()
        try:
            yield
        finally:
            with self._interruption.deferred():
                over.set()
                thread.join()

    def _write(self, line: Mapping[str, Any], event: RunEvent | None) -> None:
        with self._interruption.deferred():  # no torn lines
            written = self.folder.write_event(str(line["event"]), line)
            if self._on_event is not None:
                self._on_event(event or event_of(written))

    def _show(self) -> None:
        if self._on_event is not None:
            status = self.status
            current = None if status.current is None else replace(status.current)
            workers = tuple(replace(one) for one in status.workers)
            counts = replace(status.episodes)
            self._on_event(Progress(status.state, counts, current, workers, status.eta_s))
