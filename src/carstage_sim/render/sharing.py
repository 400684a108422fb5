"""Threads that share work in Python: each takes the next part of it until nothing is left.

Work that is compiled as a whole belongs to a :class:`carstage_sim.render.crew.Crew`, which begins
sooner.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable


class _Job:
    """Work that some threads do at the same time; it has a gate that opens when it is done.

    Who returns from the work found nothing left of it: who comes later need not begin, and nobody
    waits for him.
    """

    def __init__(self, work: Callable[[], None]) -> None:
        self._work = work
        self._lock = threading.Lock()
        self._working = 0
        self._nothing_left = False
        self._error: BaseException | None = None
        self._gate = threading.Lock()
        self._gate.acquire()

    def do(self) -> None:
        """Do one thread's share, if there is anything left."""
        with self._lock:
            if self._nothing_left:
                return
            self._working += 1
        error = None
        try:
            self._work()
        except BaseException as raised:  # noqa: BLE001 - raised by who waits for it
            error = raised
        with self._lock:
            self._error = self._error or error
            self._nothing_left = True
            self._working -= 1
            done = not self._working
        if done:
            self._gate.release()

    def wait(self) -> None:
        """Wait until all who began have ended; raises what the first of them raised."""
        self._gate.acquire()
        if self._error is not None:
            raise self._error


class Team:
    """A number of threads; whoever hands them work waits for it.

    Args:
        threads: how many; one stands for none, the caller does all.
        name: what the threads are called.
    """

    def __init__(self, threads: int, name: str) -> None:
        self.threads = threads
        # No bound is needed: whoever puts a job in waits until it is done.
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._members = [
            threading.Thread(target=self._run, name=f"{name}_{number}", daemon=True)
            for number in range(threads if threads > 1 else 0)
        ]
        for member in self._members:
            member.start()

    def close(self) -> None:
        """End the threads when their work is done."""
        for _ in self._members:
            self._jobs.put(None)
        for member in self._members:
            member.join()
        self._members.clear()

    def do(self, work: Callable[[], None], parts: int, *, joined: bool = False) -> None:
        """Let as many threads as there are parts, at most all, call ``work``; returns afterwards.

        Args:
            work: takes one part after the other until none is left.
            parts: how many there are.
            joined: whether the caller takes parts, too. It begins at once, while the threads may be
                busy with others' work; but then one more thread computes than there should be.
        """
        hands = min(parts - joined, len(self._members))
        if hands + joined < 2 or not self._members:
            work()
            return
        job = _Job(work)
        for _ in range(hands):
            self._jobs.put(job)
        if joined:
            job.do()
        job.wait()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job.do()
