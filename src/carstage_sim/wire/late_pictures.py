"""Pictures that the world does not wait for, because nobody has shown that he reads them."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Set
from dataclasses import dataclass

from carstage_sim.wire.streaming import Taking

_MANY_WAITING, _MOST_WAITING = 16, 64
_MOST_OF_OWN = 1
"""Pictures of a sensor that may wait when who spawned it ticks again."""
_PATIENCE_S = 0.1
"""In one tick, for all that is late."""


class LatePictures:
    """Counts the pictures of each stream that wait to be drawn after those of other streams.

    In synchronous mode the next tick waits for the pictures of the last one. Those of light take
    long, and whoever subscribes to cameras without reading would slow down the one who ticks. So a
    stream's pictures may be late until a subscriber has taken what it was sent. Then each tick
    leaves a moment for them until none is late: not for each, but for all together. It also does
    where many wait of streams that nobody has read. None is lost, unless who subscribed takes
    nothing for seconds; where very many wait of a stream that is read, the next tick waits for one.

    A tick waits for pictures of the sensors of who asks for it, read or not, until one of each is
    late at most, or one fewer than before the last tick. So they do not pile up, however slow the
    machine is. Where several clients want a tick, one that is owed nothing gets it for all.

    Args:
        taking: tells by stream number what the subscribers take.
        changed: called when fewer pictures wait.
    """

    def __init__(self, taking: Callable[[int], Taking], changed: Callable[[], None]) -> None:
        self._taking = taking
        self._changed = changed
        self._lock = threading.Lock()
        self._waiting: Counter[int] = Counter()
        self._client_of: dict[int, int] = {}
        self._allowed: dict[int, int] = {}
        self._asking: Set[int] = frozenset()
        self._owed: Set[int] = frozenset()
        self._patient_until_s = math.inf

    def turn(self, stream_id: int, client: int = 0) -> LatePicture | None:
        """The turn of a stream's next picture if it may be late; it must, if an earlier one is.

        Args:
            stream_id: the stream.
            client: whose sensor it is; 0: nobody's.
        """
        with self._lock:
            if not self._waiting[stream_id] and self._taking(stream_id) is Taking.ALL:
                return None
            self._waiting[stream_id] += 1
            self._client_of[stream_id] = client
        return LatePicture(self, stream_id)

    def begin_frame(self) -> None:
        """A frame is under way; from now on, the next tick leaves a moment for what is late."""
        with self._lock:
            self._patient_until_s = time.monotonic() + _PATIENCE_S
            # One of each stream that waits is this frame's.
            self._allowed = {
                stream_id: max(_MOST_OF_OWN, count - 2)
                for stream_id, count in self._waiting.items()
            }
            self._see_what_is_owed()

    def asked_by(self, clients: Set[int]) -> None:
        """Who wants a tick now, by client."""
        with self._lock:
            if clients != self._asking:
                self._asking = clients
                self._see_what_is_owed()

    def _see_what_is_owed(self) -> None:
        """Find the streams that the next tick waits for because of who asks. The lock is held."""
        owed = {
            stream_id
            for stream_id, count in self._waiting.items()
            if count > self._allowed.get(stream_id, count)
            and self._client_of[stream_id] in self._asking
        }
        for_all = self._asking <= {self._client_of[stream_id] for stream_id in owed}
        self._owed = owed if for_all else frozenset()

    @property
    def hold_up_the_world(self) -> bool:
        """Whether the next tick waits for late pictures."""
        with self._lock:
            if self._owed:
                return True
            waiting = dict(self._waiting)
            is_patient = time.monotonic() < self._patient_until_s
        if is_patient:
            return any(self.urgency(stream_id) > 0 for stream_id in waiting)
        most = [stream_id for stream_id, count in waiting.items() if count >= _MOST_WAITING]
        return any(self._taking(stream_id) is Taking.ALL for stream_id in most)

    def urgency(self, stream_id: int) -> int:
        """Pictures of a stream with more come first.

        3 if a tick waits for them because of who asks for it, 2 if it is read, 1 if many wait,
        else 0.
        """
        with self._lock:
            if stream_id in self._owed:
                return 3
            waiting = self._waiting[stream_id]
        if waiting and self._taking(stream_id) is Taking.ALL:
            return 2
        return int(waiting >= _MANY_WAITING)

    def may_be_taken(self, stream_id: int) -> bool:
        """Whether anybody may still take a picture of a stream."""
        return self._taking(stream_id) is not Taking.NOTHING

    def end(self, stream_id: int) -> None:
        """One of the pictures that waited is drawn, or left out."""
        with self._lock:
            self._waiting[stream_id] -= 1
            if not self._waiting[stream_id]:
                del self._waiting[stream_id], self._client_of[stream_id]
            if stream_id in self._owed:
                self._see_what_is_owed()
        self._changed()


@dataclass(frozen=True, slots=True)
class LatePicture:
    """The turn of one picture that may be late, of a stream."""

    pictures: LatePictures
    stream_id: int

    @property
    def worth_making(self) -> bool:
        """Whether anybody may still take it."""
        return self.pictures.may_be_taken(self.stream_id)

    def urgency(self) -> int:
        """Pictures of streams with more come first; see :meth:`LatePictures.urgency`."""
        return self.pictures.urgency(self.stream_id)

    def end(self) -> None:
        """It is drawn, or left out."""
        self.pictures.end(self.stream_id)
