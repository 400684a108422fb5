"""From sensor callbacks to the log: the byte budget, the matcher's thread, the ledger.

Callbacks only put a reference into the inbox (the ``carla`` object keeps its buffer alive). One
thread joins what comes by frame and hands it to the writers.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from queue import Empty, SimpleQueue
from types import MappingProxyType
from typing import Any, Callable, Deque, Dict, List, Mapping, NamedTuple, Optional, Tuple

from carstage.collector.internals.errors import RecordingError, writing_failed
from carstage.collector.internals.matching import (
    OFF,
    OK,
    ExpectedFrame,
    FrameMatcher,
    JoinedFrame,
    LedgerRow,
    LostData,
)
from carstage.collector.internals.snapshots import WorldMoment
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.internals.writing import LogWriters, Write
from carstage.collector.sensors.base import Sensor
from carstage.rawlog.format import KIND_DATA, KIND_TABLE, LEDGER, WORLD

_log = logging.getLogger(__name__)

POLL_S = 0.1
_OVERRUN = "came while too much waited for the disk"
MAX_CONSECUTIVE_MISSES = 5
"""A sensor that misses that many frames in a row is dead; waiting for more of them is pointless."""


class ByteBudget:
    """Counts the bytes of sensor data that are in memory; the tick waits when there are too many.

    Args:
        limit_bytes: what may wait for the disk.
        tick_bytes: what one more tick will bring; there is room for it when it fits into the limit,
            or when nothing waits.
    """

    def __init__(self, limit_bytes: int, tick_bytes: int = 0) -> None:
        self._limit_bytes = limit_bytes
        self._tick_bytes = tick_bytes
        self._held_bytes = 0
        self._due_bytes = 0
        self._changed = threading.Condition()

    @property
    def held_bytes(self) -> int:
        """Bytes in memory now."""
        return self._held_bytes

    @property
    def is_roomy(self) -> bool:
        """Whether three quarters of the limit are free."""
        return 4 * self._held_bytes <= self._limit_bytes

    def take(self, size_bytes: int) -> None:
        """Count data that came."""
        with self._changed:
            self._held_bytes += size_bytes

    def take_if_room(self, size_bytes: int) -> bool:
        """Count data that came, unless more would wait than may; return whether they count."""
        with self._changed:
            if self._held_bytes and self._held_bytes + size_bytes > self._limit_bytes:
                return False
            self._held_bytes += size_bytes
            return True

    def give_back(self, size_bytes: int) -> None:
        """Count data that were written or dropped."""
        with self._changed:
            self._held_bytes -= size_bytes
            self._changed.notify_all()

    def expect_tick(self) -> None:
        """Keep room for the data of a tick that was made and whose data are on the way."""
        with self._changed:
            self._due_bytes += self._tick_bytes

    def tick_came(self) -> None:
        """Nothing more comes of a tick that was expected."""
        with self._changed:
            self._due_bytes -= self._tick_bytes
            self._changed.notify_all()

    def wait_for_room(self, timeout_s: float) -> bool:
        """Wait until there is room, at most ``timeout_s``; return whether there is."""
        with self._changed:
            return self._changed.wait_for(self._has_room, timeout_s)

    def _has_room(self) -> bool:
        taken_bytes = self._held_bytes + self._due_bytes
        return not taken_bytes or taken_bytes + self._tick_bytes <= self._limit_bytes


class _Datum(NamedTuple):
    sensor: str
    frame: int
    data: Any
    size_bytes: int


_LOOK = object()
"""In the inbox: nothing but a sign that ticks were announced."""

_FORGET_EARLY = object()
"""In the inbox: drop the data of ticks that were not announced."""

_BEGIN_WITH_ALL = object()
"""In the inbox: begin with the first frame that every sensor delivered."""


class _End(NamedTuple):
    """In the inbox: so many ticks were announced in all."""

    ticks: int


class _Hold(NamedTuple):
    """In the inbox: whether frames stay open that lack data."""

    holds: bool


_END_WITH_WHOLE = object()
"""In the inbox: nothing more comes; the recording ends with the last whole frame."""


class Pipeline:
    """Takes sensor data and ticks, writes the log; a context manager.

    Args:
        sensors: sensor id to its kind's class, in the order of the ledger.
        writers: the log's writers, already running.
        matcher: joins data by frame.
        budget: counts what waits.
        steps: ticks that will be recorded; None: :meth:`end` tells it.
        ticks_per_segment: ticks per segment.
        strict: an incomplete frame is a fault; a sensor that dies ends the episode.
        failures: errors of all threads, the writers' too; the main thread raises the first.
        clock_s: monotonic time.
        pause_s: what comes is looked at so far apart, while there is room. Threads that wake for
            each datum take the processor from a world that does not wait for them.
        on_start: called first in the matcher's thread.
        on_expected: called in the matcher's thread with each announced tick.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        writers: LogWriters,
        matcher: FrameMatcher,
        budget: ByteBudget,
        steps: Optional[int],
        ticks_per_segment: int,
        strict: bool = True,
        failures: Optional[List[BaseException]] = None,
        clock_s: Callable[[], float] = time.monotonic,
        pause_s: float = 0.0,
        on_start: Callable[[], None] = lambda: None,
        on_expected: Callable[[ExpectedFrame], None] = lambda expected: None,
    ) -> None:
        self._pause_s = pause_s
        self._on_expected = on_expected
        self._on_start = on_start
        self._ended = threading.Event()
        self._sensors = sensors
        self._writers = writers
        self._matcher = matcher
        self._budget = budget
        self._steps = steps
        self._ticks_per_segment = ticks_per_segment
        self._strict = strict
        self._clock_s = clock_s
        self._inbox: SimpleQueue[Any] = SimpleQueue()
        self._came: Deque[Any] = deque()
        self._announced: Deque[Tuple[ExpectedFrame, float]] = deque()
        self._state = threading.Condition()
        self._sparse = tuple(name for name, sensor in sensors.items() if sensor.kind.is_sparse)
        self._newest: Dict[str, int] = dict.fromkeys(sensors, -1)
        self._written_ticks = 0
        self._booked_ticks = 0
        self._began_after: Optional[int] = None
        self._whole_ticks: Optional[int] = None
        self._incomplete_ticks = 0
        self._waited_s = 0.0
        self._failures = [] if failures is None else failures
        self._thread = threading.Thread(target=self._run, name="matcher")

    @property
    def incomplete_ticks(self) -> int:
        """Ticks booked so far with a sensor that is neither ok nor off."""
        return self._incomplete_ticks

    @property
    def queued_bytes(self) -> int:
        """Sensor data in memory now."""
        return self._budget.held_bytes

    @property
    def waited_s(self) -> float:
        """How long ticks had to wait for room, in sum."""
        return self._waited_s

    def __enter__(self) -> Pipeline:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._inbox.put(None)
        self._ended.set()
        self._thread.join()

    def check(self) -> None:
        """Raise what went wrong in another thread.

        Raises:
            RecordingError: with the cause.
        """
        error = self._failures[0] if self._failures else None
        if isinstance(error, RecordingError):
            raise error
        if isinstance(error, OSError):
            raise writing_failed(error) from error
        if error is not None:
            raise RecordingError(
                "Recording failed: %s." % error, "See the collector's log."
            ) from error

    def callback(self, sensor: str) -> Callable[[Any], None]:
        """The function to give to ``listen``: it counts the data and queues the reference."""
        size_bytes = self._sensors[sensor].size_bytes
        take, put = self._budget.take, self._inbox.put

        def deliver(data: Any) -> None:
            size = size_bytes(data)
            take(size)
            put(_Datum(sensor, data.frame, data, size))

        return deliver

    def callback_within_budget(self, sensor: str) -> Callable[[Any], None]:
        """As :meth:`callback`, where nobody can make the world wait: what overruns is lost.

        The ledger then says so, and the data go at once.
        """
        size_bytes = self._sensors[sensor].size_bytes
        take, put = self._budget.take_if_room, self._inbox.put

        def deliver(data: Any) -> None:
            size = size_bytes(data)
            if take(size):
                put(_Datum(sensor, data.frame, data, size))
            else:
                put(_Datum(sensor, data.frame, LostData(_OVERRUN), 0))

        return deliver

    def begin_with_all(self, timeout_s: float) -> Optional[int]:
        """Begin with the first frame from which on every sensor delivered, and lost nothing.

        Returns:
            The last frame before it; None when the matcher did not come to it in time.
        """
        self._inbox.put(_BEGIN_WITH_ALL)
        with self._state:
            self._state.wait_for(
                lambda: self._began_after is not None or bool(self._failures), timeout_s
            )
        self.check()
        return self._began_after

    def end(self, ticks: int) -> None:
        """Tell how many ticks there are, where that was not known before; seals what is open."""
        self._inbox.put(_End(ticks))

    def hold(self, holds: bool) -> None:
        """Keep frames open that lack data, while nobody knows whether any will come."""
        self._inbox.put(_Hold(holds))

    def end_with_whole(self) -> int:
        """End with the last frame that is whole, as nothing more comes; seals what is open.

        Returns:
            How many ticks there are; those announced after them are given up.
        """
        self._inbox.put(_END_WITH_WHOLE)
        ticks = None
        while ticks is None:
            with self._state:
                self._state.wait_for(
                    lambda: self._whole_ticks is not None or bool(self._failures), POLL_S
                )
                ticks = self._whole_ticks
            self.check()
        return ticks

    def begin(self, after_frame: int) -> None:
        """Begin to record: data up to and including ``after_frame`` belong to the warm-up."""
        self._inbox.put(after_frame)

    def expect(self, expected: ExpectedFrame) -> None:
        """Announce a tick; ``expected.context`` is its :class:`WorldMoment`.

        To wake the matcher's thread costs the one that ticks. It looks at what is announced when
        data come, at the next tick, and before anybody waits for it.
        """
        if self._strict:  # elsewhere a frame may stay open although nothing of it will come
            self._budget.expect_tick()
        self._show_announced()
        self._announced.append((expected, self._clock_s()))

    def _show_announced(self) -> None:
        if self._announced:
            self._inbox.put(_LOOK)

    def wait_for_room(self, stop: StopRequest) -> None:
        """Wait until the budget lets in another tick.

        A server that runs on its own makes frames meanwhile; nobody sees their ticks, and their
        data would fill the budget for ever.

        Raises:
            RecordingError: something broke in another thread.
            InterruptedByRequestError: somebody asked to end.
        """
        if self._budget.wait_for_room(0.0):
            self.check()
            return
        self._show_announced()
        begin_s = self._clock_s()
        try:
            while not self._budget.wait_for_room(POLL_S):
                self.check()
                stop.check()
                if not self._strict:
                    self._inbox.put(_FORGET_EARLY)
        finally:
            self._waited_s += self._clock_s() - begin_s
        self.check()

    def newest(self, sensor: str) -> int:
        """The newest frame that a sensor delivered; -1 before the first."""
        return self._newest[sensor]

    def wait_delivered(
        self, frame: int, timeout_s: float, instead: Mapping[str, int] = MappingProxyType({})
    ) -> Tuple[str, ...]:
        """Wait until every sensor delivered ``frame`` or a later one; return those that did not.

        Sensors that may have nothing to deliver are not waited for.

        Args:
            frame: of the server.
            timeout_s: how long.
            instead: other frames by sensor.
        """

        def lacking() -> Tuple[str, ...]:
            return tuple(
                name
                for name, newest in self._newest.items()
                if newest < instead.get(name, frame) and name not in self._sparse
            )

        with self._state:
            self._state.wait_for(lambda: bool(not lacking() or self._failures), timeout_s)
            return lacking()

    def wait_booked(self, ticks: int, timeout_s: float) -> bool:
        """Wait until that many ticks are in the ledger's queue; return whether they are."""
        self._show_announced()
        with self._state:
            self._state.wait_for(
                lambda: bool(self._booked_ticks >= ticks or self._failures), timeout_s
            )
        self.check()
        return self._booked_ticks >= ticks

    def _run(self) -> None:
        try:
            self._on_start()
            while self._step():
                if self._pause_s and self._inbox.empty() and self._budget.is_roomy:
                    self._ended.wait(self._pause_s)
        except BaseException as error:  # noqa: BLE001 - handed to the main thread, which raises it
            with self._state:
                self._failures.append(error)
                self._state.notify_all()
            self._give_back_rest()

    def _give_back_rest(self) -> None:
        """Take what still comes, so that nobody waits for room, until the end."""
        while True:
            item = self._came.popleft() if self._came else self._inbox.get()
            if item is None:
                return
            if isinstance(item, _Datum):
                self._budget.give_back(item.size_bytes)

    def _step(self) -> bool:
        """Wait for something, then handle all that came; return whether more may come."""
        deadline_s = self._matcher.next_deadline_s()
        try:
            first = self._inbox.get(
                timeout=None if deadline_s is None else max(0.0, deadline_s - self._clock_s())
            )
        except Empty:
            self._take_announced()
            self._pass_on(self._clock_s())
            return True
        self._take_announced()
        now_s = self._clock_s()
        came = self._came
        came.append(first)
        came.extend(self._inbox.get_nowait() for _ in range(self._inbox.qsize()))
        delivered = False
        while came:
            item = came.popleft()
            if isinstance(item, _Datum):
                offered = item.data if isinstance(item.data, LostData) else item
                self._matcher.offer(item.sensor, item.frame, offered, now_s)
                self._newest[item.sensor] = max(self._newest[item.sensor], item.frame)
                delivered = True
            elif item is not _LOOK:
                self._pass_on(now_s)  # what came before it comes first
                if item is None:
                    return False
                self._obey(item)
        if delivered:
            with self._state:
                self._state.notify_all()
        self._pass_on(now_s)
        return True

    def _take_announced(self) -> None:
        """Tell the matcher of the ticks that were made meanwhile, and when."""
        while self._announced:
            expected, made_s = self._announced.popleft()
            self._matcher.expect(expected, made_s)
            self._on_expected(expected)

    def _obey(self, item: Any) -> None:
        """Do what the main thread asks for."""
        matcher = self._matcher
        if isinstance(item, int):
            matcher.begin(item)
        elif isinstance(item, _End):
            self._end(item.ticks)
        elif isinstance(item, _Hold):
            matcher.hold(item.holds)
        elif item is _END_WITH_WHOLE:
            matcher.drop_open()
            self._end(self._written_ticks)
            with self._state:
                self._whole_ticks = self._written_ticks
                self._state.notify_all()
        elif item is _BEGIN_WITH_ALL:
            with self._state:
                self._began_after = matcher.begin_with_all()
                self._state.notify_all()
        elif item is _FORGET_EARLY:
            matcher.forget_early()

    def _pass_on(self, now_s: float) -> None:
        """Give the writers what is whole, and the budget what is given up."""
        matcher = self._matcher
        matcher.advance(now_s)
        for frame in matcher.take_joined():
            self._write_frame(frame)
        for row in matcher.take_rows():
            self._write_row(row)
        for sensor, number in matcher.take_too_late():
            self._miss_late(sensor, number)
        for datum in matcher.take_dropped():
            if not isinstance(datum, LostData):
                self._budget.give_back(datum.size_bytes)

    def _end(self, ticks: int) -> None:
        """Seal the last segment as far as its ticks are written already."""
        self._steps = ticks
        if ticks % self._ticks_per_segment == 0:
            return  # sealed as a whole one, or about to be
        if self._written_ticks == ticks:
            self._writers.seal([*self._sensors, WORLD], ticks - 1)
        if self._booked_ticks == ticks:
            self._writers.seal([LEDGER], ticks - 1)

    def _ends_segment(self, tick: int) -> bool:
        return (tick + 1) % self._ticks_per_segment == 0 or tick + 1 == self._steps

    def _write_frame(self, frame: JoinedFrame) -> None:
        expected = frame.expected
        moment: WorldMoment = expected.context
        if self._strict:
            self._budget.tick_came()
        at = (expected.tick, expected.frame, expected.timestamp_s)
        if expected.seen:
            table = moment.table()
            if table is not None:
                self._writers.write(Write(WORLD, KIND_TABLE, *at, lambda: (table, b""), 0))
            self._writers.write(Write(WORLD, KIND_DATA, *at, moment.encode, 0))
        for sensor, datum in frame.data.items():
            if expected.k is None:
                self._budget.give_back(datum.size_bytes)
                continue
            encode = self._sensors[sensor].encode
            self._writers.write(
                Write(sensor, KIND_DATA, *at, _content(encode, datum.data), datum.size_bytes)
            )
        for sensor in frame.empty if expected.k is not None else ():
            self._writers.write(Write(sensor, KIND_DATA, *at, _nothing, 0))
        if self._ends_segment(expected.tick):
            self._writers.seal([*self._sensors, WORLD], expected.tick)
        self._written_ticks += 1
        self._give_up_on_dead_sensors(expected)

    def _miss_late(self, sensor: str, frame: int) -> None:
        """Data came for a frame that was written as empty."""
        text = "%s: data of frame %d came after the frame was written without them" % (
            sensor,
            frame,
        )
        if self._strict:
            raise RecordingError(text + ".", "The machine is too busy; a retry starts anew.")
        _log.warning(text)

    def _give_up_on_dead_sensors(self, expected: ExpectedFrame) -> None:
        if not self._strict:
            return
        for sensor, misses in self._matcher.misses.items():
            if misses >= MAX_CONSECUTIVE_MISSES:
                raise RecordingError(
                    "Sensor %s delivered nothing for %d ticks in a row, up to frame %d."
                    % (sensor, misses, expected.frame),
                    "Look into the server's log; a retry starts the episode anew.",
                )

    def _write_row(self, row: LedgerRow) -> None:
        expected = row.expected
        if any(outcome.state not in (OK, OFF) for outcome in row.sensors.values()):
            self._incomplete_ticks += 1
        meta = {
            "k": expected.k,
            "tick_s": expected.tick_s,
            "sensors": {sensor: outcome._asdict() for sensor, outcome in row.sensors.items()},
        }
        at = (expected.tick, expected.frame, expected.timestamp_s)
        self._writers.write(Write(LEDGER, KIND_DATA, *at, lambda: (meta, b""), 0))
        if self._ends_segment(expected.tick):
            self._writers.seal([LEDGER], expected.tick)
        with self._state:
            self._booked_ticks += 1
            self._state.notify_all()


def _nothing() -> Any:
    return {}, b""


def _content(encode: Callable[[Any], Any], data: Any) -> Callable[[], Any]:
    def content() -> Any:
        meta, payload = encode(data)
        return dict(meta, sensor_timestamp_s=data.timestamp), payload

    return content
