"""Pictures that the world does not wait for, because nobody has shown that he reads them."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from carstage_sim.wire.streaming import Taking

_MOST_WAITING = 16


class LatePictures:
    """Counts the pictures of each stream that wait to be drawn after those of other streams.

    In synchronous mode the next tick waits for the pictures of the last one. Those of light take
    long, and whoever subscribes to cameras without reading would slow down the one who ticks. So a
    stream's pictures may be late until a subscriber has taken what it was sent: then the next tick
    waits for them as for all others. None is lost, unless who subscribed takes nothing for seconds.

    Args:
        taking: tells by stream number what the subscribers take.
        changed: called when fewer pictures wait.
    """

    def __init__(self, taking: Callable[[int], Taking], changed: Callable[[], None]) -> None:
        self._taking = taking
        self._changed = changed
        self._lock = threading.Lock()
        self._waiting: Counter[int] = Counter()

    def turn(self, stream_id: int) -> LatePicture | None:
        """The turn of a stream's next picture if it may be late; it must, if an earlier one is."""
        with self._lock:
            if not self._waiting[stream_id] and self._taking(stream_id) is Taking.ALL:
                return None
            self._waiting[stream_id] += 1
        return LatePicture(self, stream_id)

    @property
    def hold_up_the_world(self) -> bool:
        """Whether the next tick waits for late pictures: for a reader, or as too many wait."""
        with self._lock:
            waiting = +self._waiting
        return any(
            count >= _MOST_WAITING or self._taking(stream_id) is Taking.ALL
            for stream_id, count in waiting.items()
        )

    def may_be_taken(self, stream_id: int) -> bool:
        """Whether anybody may still take a picture of a stream."""
        return self._taking(stream_id) is not Taking.NOTHING

    def end(self, stream_id: int) -> None:
        """One of the pictures that waited is drawn, or left out."""
        with self._lock:
            self._waiting[stream_id] -= 1
            if not self._waiting[stream_id]:
                del self._waiting[stream_id]
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

    def end(self) -> None:
        """It is drawn, or left out."""
        self.pictures.end(self.stream_id)
