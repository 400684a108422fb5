"""Wakes the client's Traffic Manager when it has slept through its cue.

The wheels up to 0.9.16 start and end the Traffic Manager's synchronous step by setting a flag and
notifying without holding the mutex (carla-simulator/carla, issue 9172). On busy cores, about once
in some ten thousand ticks, a notification is lost and ``World.tick`` waits for ever, whatever the
server. Leaving synchronous mode notifies once more. The Traffic Manager's Python methods cannot ask
for that, because the tick holds their mutex; its own RPC port can.

A Traffic Manager that is only slow would take the same for a second step, so it is left alone: as
long as one of the threads runs, or the server has not answered what was asked last. What was woken
before its step, and was back in synchronous mode before the step's end, did what it always does.
After any other wake-up the recording may differ, and the attempt is given up.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from contextlib import contextmanager
from typing import Any, Collection, Iterator, NamedTuple, Optional, Set

PATIENCE_S = 5.0
LOOK_EVERY_S = 0.5
ANSWER_TIMEOUT_S = 5.0
# MessagePack-RPC: [request, number, "set_synchronous_mode", [false]], then the same with true.
REQUESTS = (
    b"\x94\x00\x00\xb4set_synchronous_mode\x91\xc2\x94\x00\x01\xb4set_synchronous_mode\x91\xc3"
)
# Twice [response, number, no error, no result].
ANSWER_BYTES = 10
_SURELY_LESS = 0.5
"""Less than this share of the CPU time of its shortest step: the step has not been done."""
_THREAD_CPU_CLOCK = 6
"""The lowest bits of the clock of a thread's CPU time; the others are its inverted number."""

_log = logging.getLogger(__name__)


def wake_traffic_manager(port: int) -> None:
    """Have the Traffic Manager on a port of this machine leave synchronous mode and return to it.

    Raises:
        OSError: nobody answers there.
    """
    with socket.create_connection(("127.0.0.1", port), timeout=ANSWER_TIMEOUT_S) as connection:
        connection.sendall(REQUESTS)
        missing = ANSWER_BYTES
        while missing > 0:
            received = connection.recv(missing)
            if not received:
                raise ConnectionResetError("the Traffic Manager on port %d hung up" % port)
            missing -= len(received)


@contextmanager
def started_threads() -> Iterator[Set[int]]:
    """The kernel's numbers of threads that the block starts, libraries' too; known at its end."""
    started: Set[int] = set()
    before = set(os.listdir("/proc/self/task"))
    yield started
    started.update(int(name) for name in set(os.listdir("/proc/self/task")) - before)


def cpu_time_s(thread: int) -> float:
    """CPU time that a thread of this process has used.

    Raises:
        OSError: it has ended.
    """
    return time.clock_gettime((~thread << 3) | _THREAD_CPU_CLOCK)


def is_asleep(thread: int) -> bool:
    """Whether a thread of this process waits for somebody; False while it runs or could run."""
    with open("/proc/self/task/%d/stat" % thread) as file:
        return file.read().rpartition(")")[2].split()[0] == "S"


class _TickUnderWay(NamedTuple):
    """What held when the tick began."""

    frame_before: int
    thread: int
    manager_cpu_s: float


class TickWatch:
    """A thread that looks whether a tick is stuck behind the Traffic Manager.

    Args:
        world: ``carla.World``.
        port: of the Traffic Manager in this process.
        manager: the Traffic Manager's threads. Where none are known, every wake-up is one that may
            have changed something.
        patience_s: how long everything has to be still, after the frame of the tick has come.
        look_every_s: how often to look.

    Attributes:
        wake_ups: how often it was stuck.
        changed: whether a wake-up may have changed what the Traffic Manager does.
    """

    def __init__(
        self,
        world: Any,
        port: int,
        manager: Collection[int],
        patience_s: float = PATIENCE_S,
        look_every_s: float = LOOK_EVERY_S,
    ) -> None:
        self._world = world
        self._port = port
        self._patience_s = patience_s
        self._look_every_s = look_every_s
        self._manager = frozenset(manager)
        self._least_step_s = float("inf")
        self._tick: Optional[_TickUnderWay] = None
        self._last: Optional[_TickUnderWay] = None
        self._waking = threading.Lock()
        self.wake_ups = 0
        self.changed = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="tick watch", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join()

    @contextmanager
    def over_a_tick(self) -> Iterator[None]:
        """Watch while the block runs, which ticks the world once; ``changed`` is known after it."""
        frame = self._world.get_snapshot().frame
        tick = _TickUnderWay(frame, threading.get_native_id(), self._manager_cpu_s())
        if self._last is not None and tick.manager_cpu_s > self._last.manager_cpu_s:
            step_s = tick.manager_cpu_s - self._last.manager_cpu_s
            self._least_step_s = min(self._least_step_s, step_s)
        self._tick = tick
        try:
            yield
        finally:
            self._tick, self._last = None, tick
        with self._waking:  # the verdict on a wake-up may still be coming
            pass

    def _manager_cpu_s(self) -> float:
        """CPU time of the thread that steps: the busiest of the Traffic Manager's."""
        used_s = [0.0]
        for thread in self._manager:
            try:
                used_s.append(cpu_time_s(thread))
            except OSError:  # it has ended; what a step needs has to be learnt anew
                self._manager -= {thread}
                self._least_step_s = float("inf")
        return max(used_s)

    def _watch(self) -> None:
        since_s = 0.0
        before: Any = None
        while not self._stop.wait(self._look_every_s):
            tick = self._tick
            seen = None if tick is None else self._stillness(tick)
            if tick is None or seen is None or (tick, seen) != before:
                before, since_s = (tick, seen), time.monotonic()
            elif time.monotonic() - since_s > self._patience_s:
                if self._server_answers() and self._stillness(tick) == seen:
                    with self._waking:
                        if self._tick is tick:
                            self._wake(tick, seen)
                before = None

    def _stillness(self, tick: _TickUnderWay) -> Optional[float]:
        """The Traffic Manager's CPU time since the tick began; None while anything goes on.

        As long as its frame has not come, a slow tick is the server's business.
        """
        try:
            if self._world.get_snapshot().frame <= tick.frame_before:
                return None
            if not all(is_asleep(thread) for thread in (tick.thread, *self._manager)):
                return None
        except OSError:  # a thread ends: the tick or the Traffic Manager is over
            return None
        return self._manager_cpu_s() - tick.manager_cpu_s

    def _server_answers(self) -> bool:
        """Whether the server has answered all that this process asked before."""
        try:
            self._world.get_settings()
        except RuntimeError:
            return False
        return True

    def _wake(self, tick: _TickUnderWay, used_s: float) -> None:
        self.wake_ups += 1
        _log.warning(
            "the Traffic Manager missed its cue after frame %d: waking it", tick.frame_before
        )
        not_yet_s = _SURELY_LESS * self._least_step_s
        asleep_since_before = bool(self._manager) and used_s < not_yet_s < float("inf")
        if not asleep_since_before:
            self.changed = True
        try:
            wake_traffic_manager(self._port)
        except OSError as error:
            _log.error("the Traffic Manager cannot be woken: %s", error)
            return
        if self._manager_cpu_s() - tick.manager_cpu_s >= not_yet_s:
            self.changed = True
