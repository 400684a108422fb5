"""Joins sensor data by frame number into frames, with a state for each sensor.

Pure logic: the clock is an argument, nothing waits here. The thread around it is in ``processing``.
"""

from __future__ import annotations

from collections import deque
from typing import AbstractSet, Any, Deque, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

OK = "ok"
MISSING = "missing"
LATE = "late"
MISMATCHED = "mismatched"
OFF = "off"

_RESTS = "it rests in ticks that are not saved"
SPARSE_PATIENCE_S = 0.5
"""How long a frame stays open for sensors that may have nothing to deliver, if none follows."""


class ExpectedFrame(NamedTuple):
    """A tick that was made: every sensor should deliver data of its frame.

    ``k`` is the saved-frame index, ``None`` when this tick is not saved; ``context`` is carried
    along untouched (the world snapshot). ``seen`` is false where the server went on by itself and
    its state of this frame never came.
    """

    tick: int
    frame: int
    timestamp_s: float
    k: Optional[int]
    tick_s: float
    context: Any
    seen: bool = True


class SensorOutcome(NamedTuple):
    """What became of one sensor in one tick; ``wait_s`` counts from the end of the tick."""

    state: str
    reason: Optional[str]
    wait_s: float


class LostData(NamedTuple):
    """Offered in place of data that came and could not be kept; ``reason`` says why."""

    reason: str


class JoinedFrame(NamedTuple):
    """A frame that is closed.

    Attributes:
        expected: its tick.
        data: whatever came for it in time, by sensor.
        empty: sparse sensors that had nothing to deliver for it.
    """

    expected: ExpectedFrame
    data: Dict[str, Any]
    empty: Tuple[str, ...] = ()


class LedgerRow(NamedTuple):
    """A tick whose outcome does not change any more."""

    expected: ExpectedFrame
    sensors: Dict[str, SensorOutcome]


class _PendingFrame:
    """A frame on its way from tick to ledger."""

    def __init__(self, expected: ExpectedFrame, now_s: float) -> None:
        self.expected = expected
        self.since_s = now_s
        self.data: Dict[str, Any] = {}
        self.outcomes: Dict[str, SensorOutcome] = {}
        self.lost: Set[str] = set()
        self.whole_s: Optional[float] = None
        self.resting: AbstractSet[str] = frozenset()

    def rest(self, sensors: AbstractSet[str]) -> None:
        """Book sensors that do not measure, as the tick is not saved."""
        self.resting = sensors
        for sensor in sensors:
            self.outcomes[sensor] = SensorOutcome(OFF, _RESTS, 0.0)

    def lacking(self, sensors: Sequence[str]) -> List[str]:
        return [sensor for sensor in sensors if sensor not in self.outcomes]


class FrameMatcher:
    """Joins data of many sensors by frame; frames are closed and booked in the order of ticks.

    A frame is closed when every sensor delivered, or ``patience_s`` after its tick. A sensor that
    delivered nothing until then is ``missing``, or ``mismatched`` when it delivered a later frame
    instead. Its row is booked after another ``patience_s``, so that data that still come
    are noted as ``late``; they are not recorded.

    Args:
        sensors: names of the sensors, in the order of the ledger.
        patience_s: how long a frame is waited for.
        skip: do not wait for a frame that a sensor has passed over already (the paper's way).
        own_timelines: sensors measure at rates of their own; in between they are ``off``.
        gather: keep what comes before the beginning, for :meth:`begin_with_all`.
        sparse: sensors that may deliver nothing for a frame, which is then ``ok`` and empty. Such a
            frame is closed when a later one is whole but for them, or :data:`SPARSE_PATIENCE_S`
            after its own others: what they deliver is on the way long before.
        resting: sensors that are ``off`` in ticks that are not saved.
    """

    def __init__(
        self,
        sensors: Sequence[str],
        patience_s: float,
        skip: bool = False,
        own_timelines: bool = False,
        gather: bool = False,
        sparse: Sequence[str] = (),
        resting: AbstractSet[str] = frozenset(),
    ) -> None:
        self._sensors = tuple(sensors)
        self._resting = resting
        self._patience_s = patience_s
        self._skip = skip
        self._own_timelines = own_timelines
        self._gather = gather
        self._sparse = tuple(sparse)
        self._dense = tuple(sensor for sensor in self._sensors if sensor not in self._sparse)
        self._newest_closed = -1
        self._too_late: List[Tuple[str, int]] = []
        self._whole_from: Dict[str, int] = {}
        self._holds = False
        self._after_frame: Optional[int] = None
        self._early: Dict[int, Dict[str, Any]] = {}
        self._waiting: Deque[_PendingFrame] = deque()
        self._closed: Deque[_PendingFrame] = deque()
        self._joined: List[JoinedFrame] = []
        self._rows: List[LedgerRow] = []
        self._dropped: List[Any] = []
        self.newest: Dict[str, int] = dict.fromkeys(self._sensors, -1)
        self.misses: Dict[str, int] = dict.fromkeys(self._sensors, 0)

    def begin(self, after_frame: int) -> None:
        """Begin to join: data up to and including ``after_frame`` belong to the warm-up."""
        self._after_frame = after_frame

    def begin_with_all(self) -> int:
        """Begin with the first frame from which on every sensor delivered, and lost nothing.

        Each sensor that is not sparse must have delivered something.

        Returns:
            The last frame before it.
        """
        after_frame = max(self._whole_from.values(), default=0) - 1
        self.begin(after_frame)
        return after_frame

    def expect(self, expected: ExpectedFrame, now_s: float) -> None:
        """Announce a tick; ticks come in order."""
        frame = _PendingFrame(expected, now_s)
        if expected.k is None and expected.seen:
            frame.rest(self._resting)
        self._waiting.append(frame)
        for sensor, data in self._early.pop(expected.frame, {}).items():
            self._accept(frame, sensor, data, now_s)
        # Frames that no tick of ours made (somebody else ticked the server).
        for stray in [number for number in self._early if number < expected.frame]:
            self._dropped.extend(self._early.pop(stray).values())

    def offer(self, sensor: str, frame: int, data: Any, now_s: float) -> None:
        """Hand in what a sensor delivered."""
        self.newest[sensor] = max(self.newest[sensor], frame)
        if self._after_frame is None and self._gather:
            self._keep_for_the_beginning(sensor, frame, data)
            return
        if self._after_frame is None or frame <= self._after_frame:
            self._dropped.append(data)
            return
        if sensor in self._sparse and frame <= self._newest_closed:
            self._too_late.append((sensor, frame))
            self._dropped.append(data)
            return
        for pending in self._waiting:
            if pending.expected.frame == frame:
                if sensor in pending.outcomes:
                    self._dropped.append(data)
                else:
                    self._accept(pending, sensor, data, now_s)
                return
        for pending in self._closed:
            if pending.expected.frame == frame:
                self._book_late(pending, sensor, now_s)
                self._dropped.append(data)
                return
        newest_tick = self._waiting[-1] if self._waiting else None
        if newest_tick is not None and frame < newest_tick.expected.frame:
            self._dropped.append(data)
            return
        # Data may arrive before the answer to their tick.
        if self._early.setdefault(frame, {}).setdefault(sensor, data) is not data:
            self._dropped.append(data)

    def hold(self, holds: bool) -> None:
        """Keep frames open however long they lack data, or again no longer than patience lasts."""
        self._holds = holds

    def drop_open(self) -> None:
        """Give up the frames that are open: the first of them is not whole."""
        for pending in self._waiting:
            self._dropped.extend(pending.data.values())
        self._waiting.clear()

    def forget_early(self) -> None:
        """Give up what came for frames that no tick was announced for so far."""
        for data in self._early.values():
            self._dropped.extend(data.values())
        self._early.clear()

    def advance(self, now_s: float) -> None:
        """Close and book every frame that is due."""
        for pending in self._waiting if self._sparse else ():
            if pending.whole_s is None and not pending.lacking(self._dense):
                pending.whole_s = now_s
        while self._waiting and self._due(self._waiting[0], now_s):
            self._close(self._waiting.popleft(), now_s)
        while self._closed and self._settled(self._closed[0], now_s):
            pending = self._closed.popleft()
            self._rows.append(
                LedgerRow(
                    pending.expected, {name: pending.outcomes[name] for name in self._sensors}
                )
            )

    def next_deadline_s(self) -> Optional[float]:
        """When :meth:`advance` has something to do even if nothing is offered; else ``None``."""
        deadlines = []
        if self._waiting and not self._holds:
            whole_s = self._waiting[0].whole_s
            patient_s = self._waiting[0].since_s + self._patience_s
            deadlines.append(patient_s if whole_s is None else whole_s + SPARSE_PATIENCE_S)
        if self._closed:
            deadlines.append(self._closed[0].since_s + 2 * self._patience_s)
        return min(deadlines) if deadlines else None

    @property
    def idle(self) -> bool:
        """Whether every announced tick is booked."""
        return not self._waiting and not self._closed

    def take_joined(self) -> List[JoinedFrame]:
        """Frames closed since the last call, in the order of ticks."""
        joined, self._joined = self._joined, []
        return joined

    def take_rows(self) -> List[LedgerRow]:
        """Rows booked since the last call, in the order of ticks."""
        rows, self._rows = self._rows, []
        return rows

    def take_too_late(self) -> List[Tuple[str, int]]:
        """Sparse sensor and frame of data that came after the frame was closed as empty."""
        too_late, self._too_late = self._too_late, []
        return too_late

    def take_dropped(self) -> List[Any]:
        """Data given up since the last call: warm-up, late, stray, forgotten or doubled."""
        dropped, self._dropped = self._dropped, []
        return dropped

    def _keep_for_the_beginning(self, sensor: str, frame: int, data: Any) -> None:
        """Keep what may be recorded, should the beginning come now; give up what surely is not."""
        if isinstance(data, LostData):
            self._whole_from[sensor] = frame + 1
        else:
            if sensor not in self._sparse:
                self._whole_from.setdefault(sensor, frame)
            self._early.setdefault(frame, {})[sensor] = data
        first = max(self._whole_from.values(), default=0)
        for number in [number for number in self._early if number < first]:
            self._dropped.extend(self._early.pop(number).values())

    def _accept(self, pending: _PendingFrame, sensor: str, data: Any, now_s: float) -> None:
        wait_s = max(0.0, now_s - pending.since_s)
        self.misses[sensor] = 0
        if isinstance(data, LostData):
            pending.outcomes[sensor] = SensorOutcome(MISSING, data.reason, wait_s)
            pending.lost.add(sensor)
            return
        pending.data[sensor] = data
        pending.outcomes[sensor] = SensorOutcome(OK, None, wait_s)

    def _due(self, pending: _PendingFrame, now_s: float) -> bool:
        lacking = pending.lacking(self._sensors)
        if not pending.expected.seen:
            return True
        if not lacking:
            return True
        if pending.whole_s is not None:
            followed = len(self._waiting) > 1 and self._waiting[1].whole_s is not None
            return bool(self._dense and followed) or now_s >= pending.whole_s + SPARSE_PATIENCE_S
        lacking = pending.lacking(self._dense)
        if not self._holds and now_s >= pending.since_s + self._patience_s:
            return True
        frame = pending.expected.frame
        return self._skip and all(self.newest[sensor] > frame for sensor in lacking)

    def _close(self, pending: _PendingFrame, now_s: float) -> None:
        expected = pending.expected
        waited_s = max(0.0, now_s - pending.since_s)
        if not expected.seen:
            self._skip_over(pending)
        self._newest_closed = expected.frame
        empty = tuple(sensor for sensor in self._sparse if sensor not in pending.outcomes)
        for sensor in empty:
            pending.outcomes[sensor] = SensorOutcome(OK, None, waited_s)
        for sensor in pending.lacking(self._sensors):
            newest = self.newest[sensor]
            if self._own_timelines:
                pending.outcomes[sensor] = SensorOutcome(
                    OFF, "it did not measure in this tick", waited_s
                )
            elif newest > expected.frame:
                pending.outcomes[sensor] = SensorOutcome(
                    MISMATCHED, "delivered frame %d and not this one" % newest, waited_s
                )
            else:
                pending.outcomes[sensor] = SensorOutcome(
                    MISSING, "delivered nothing for %.3g s" % waited_s, waited_s
                )
                self.misses[sensor] += 1
        self._joined.append(JoinedFrame(expected, pending.data, empty))
        pending.data = {}  # the writers hold it now; the row may stay open for long
        self._closed.append(pending)

    def _skip_over(self, pending: _PendingFrame) -> None:
        """Book a frame whose world is unknown: without it, data of sensors are of no use."""
        self._dropped.extend(pending.data.values())
        pending.data = {}
        outcome = SensorOutcome(MISSING, "the server went on, its state never came", 0.0)
        pending.outcomes = dict.fromkeys(self._sensors, outcome)

    def _settled(self, pending: _PendingFrame, now_s: float) -> bool:
        if now_s >= pending.since_s + 2 * self._patience_s or not pending.expected.seen:
            return True
        return all(
            outcome.state in (OK, LATE) or sensor in pending.lost or sensor in pending.resting
            for sensor, outcome in pending.outcomes.items()
        )

    def _book_late(self, pending: _PendingFrame, sensor: str, now_s: float) -> None:
        if pending.outcomes[sensor].state == OK:
            return  # delivered twice; the first is recorded
        late_s = now_s - pending.since_s
        pending.outcomes[sensor] = SensorOutcome(
            LATE, "came %.3g s after its tick, later than is waited for" % late_s, late_s
        )
