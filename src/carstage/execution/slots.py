"""Executors whose workers are processes: who gets which job, and what becomes of a dead one's.

A **slot** is a process that is a worker: it is told what to do line by line, and answers so (JSON,
one object a line). It asks for a job whenever it has room for one, so nothing waits in a slot that
another could do, and no queue grows.

To a slot: ``{"setup": …}`` first, ``{"job": …}``, ``{"idle": true}`` (none now), ``{"end": true}``.
From it: ``{"say": "want"}``, ``{"say": "done", "key": …}``, ``{"say": "error", "kind", "message",
"hint"}`` as the last thing that it says; anything else is the run's to hear.

A slot ends when it is told to, when it is interrupted, and when its line breaks.
"""

from __future__ import annotations

import json
import selectors
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Protocol

from carstage import errors
from carstage.errors import BadInputError, CarStageError, ServerError, WorkerLostError
from carstage.execution.executor import Job

POLL_S = 0.2
SILENCE_S = 600.0
"""A slot that says nothing for so long is taken for dead; one that lives says something each
second, but while it commits a large episode."""
MOST_WORKERS = 256
_DEATHS = 3
"""A slot that dies so often without finishing a job in between is not started again."""
_END_S = 60.0
_LONGEST_LINE_BYTES = 64 << 20


@dataclass(frozen=True, slots=True)
class SlotProgram:
    """What a slot runs.

    Attributes:
        module: as in ``python -m MODULE``.
        setup: what it is told first, plain values.
        log_path: file that its standard error is appended to.
        environment: added to its environment.
    """

    module: str
    setup: Mapping[str, Any]
    log_path: Path
    environment: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SlotEnd:
    """How a slot has ended.

    Attributes:
        reason: such as its exit status and the last lines of its log.
        certain: its process is gone. One on a node that does not answer may still live.
    """

    reason: str
    certain: bool


class Slot(ABC):
    """A process that is a worker, here or elsewhere."""

    ended: bool = False
    """Whether its line is closed: nothing more comes."""
    waiting: bool = False
    """Whether there is no place for it yet."""

    @abstractmethod
    def fileno(self) -> int:
        """A descriptor that becomes readable when it has said something, for ``selectors``."""

    @abstractmethod
    def read(self) -> list[dict[str, Any]]:
        """What it has said since, without waiting; sets ``ended``."""

    @abstractmethod
    def send(self, message: Mapping[str, Any]) -> None:
        """Tell it something; nothing happens where it has ended."""

    @abstractmethod
    def interrupt(self) -> None:
        """Ask it to end at once: it keeps what is wholly recorded and gives everything back."""

    @abstractmethod
    def kill(self) -> None:
        """End its process, whatever it does."""

    @abstractmethod
    def close(self) -> SlotEnd:
        """Give everything back; kills what still runs."""


class SlotWork(Protocol[Job]):
    """Jobs that slots do; a run."""

    @property
    def left(self) -> int:
        """How many jobs wait."""

    @property
    def left_s(self) -> float:
        """Seconds until all has to have ended; infinite before somebody asks for that."""

    def fileno(self) -> int:
        """A descriptor that becomes readable when ``poll`` should be called, for ``selectors``."""

    def poll(self) -> None:
        """Do what is due, several times a second.

        Raises:
            KeyboardInterrupt: the user ended the run.
        """

    def take(self) -> Job | None:
        """The next job; None: none waits now."""

    def key(self, job: Job) -> str:
        """What a slot calls the job when it is done."""

    def describe(self, job: Job) -> Mapping[str, Any]:
        """The job as plain values."""

    def program(self, slot: int) -> SlotProgram:
        """What a slot runs; slots are numbered from 1."""

    def on_message(self, slot: int, message: Mapping[str, Any]) -> None:
        """A slot has said something that is none of the executor's business."""

    def lost(self, slot: int, jobs: list[Job], end: SlotEnd, *, blame: bool) -> None:
        """A slot is gone; what it has left is to be removed, and its jobs may wait again.

        Args:
            slot: which one.
            jobs: what it had taken and not finished.
            end: how it ended. Where that is not certain, nothing may be removed that it could
                still commit.
            blame: the jobs may be to blame: this counts as a try of them.
        """


@dataclass(slots=True)
class _Member:
    """A slot that is open."""

    slot: Slot
    heard_s: float
    jobs: dict[str, Any] = field(default_factory=dict)
    wants: bool = False
    told_idle: bool = False


class LineBuffer:
    """Bytes of a line's other end, as messages."""

    def __init__(self) -> None:
        self._rest = b""

    def messages(self, data: bytes) -> list[dict[str, Any]]:
        """The messages that are whole now.

        Raises:
            WorkerLostError: that is no message.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _LONGEST_LINE_BYTES:
            raise WorkerLostError("A worker wrote a line that does not end.")
        return [_message(line) for line in lines if line.strip()]


def _message(line: bytes) -> dict[str, Any]:
    try:
        message = json.loads(line)
    except ValueError:
        message = None
    if not isinstance(message, dict):
        raise WorkerLostError(f"A worker wrote a line that is no message: {line[:80]!r}.")
    return message


def error_of(message: Mapping[str, Any]) -> CarStageError:
    """The error that a slot has told."""
    kind = getattr(errors, str(message.get("kind")), CarStageError)
    if not (isinstance(kind, type) and issubclass(kind, CarStageError)):
        kind = CarStageError
    return kind(str(message.get("message")), str(message.get("hint") or ""))


class SlotsExecutor(ABC):
    """Lets slots do jobs; where they are is the derived class's matter.

    Args:
        count: how many slots there are at most.
    """

    in_process: ClassVar[bool] = False

    def __init__(self, count: int) -> None:
        if count < 1:
            raise BadInputError(f"workers: {count} is not a number of workers.", "Give 1 or more.")
        self.count = count

    @property
    def cores_per_worker(self) -> int | None:
        """Cores of each worker; None: a share of this machine."""
        return None

    def opened(self) -> AbstractContextManager[None]:
        """A stretch in which it may ``execute``, and ``count`` is known.

        Raises:
            BadInputError: what it needs is not there.
        """
        return nullcontext()

    @abstractmethod
    def open_slot(self, number: int, program: SlotProgram) -> Slot:
        """Start a slot; returns at once.

        Raises:
            CarStageError: that cannot be.
        """

    def execute(self, work: SlotWork[Any]) -> None:
        """See ``Executor.execute``."""
        crew = _Crew(self, work)
        try:
            crew.work_off()
            crew.end(at_once=False)
        except BaseException:
            crew.end(at_once=True)
            raise


class _Crew:
    """The open slots of one ``execute``."""

    def __init__(self, executor: SlotsExecutor, work: SlotWork[Any]) -> None:
        self._executor = executor
        self._work = work
        self._members: dict[int, _Member] = {}
        self._deaths = Counter[int]()
        self._given_up: dict[int, CarStageError] = {}

    def work_off(self) -> None:
        """Let slots do the jobs until all are done."""
        while True:
            self._work.poll()
            self._open_slots()
            self._give_jobs()
            if not self._work.left and not any(one.jobs for one in self._members.values()):
                return
            self._listen(POLL_S)
            self._end_silent()

    def end(self, *, at_once: bool) -> None:
        """End all slots and hear their last words; what does not end in time is killed."""
        for member in self._members.values():
            member.slot.interrupt() if at_once else member.slot.send({"end": True})
        deadline_s = time.monotonic() + min(self._work.left_s, _END_S)
        while self._members and time.monotonic() < deadline_s:
            self._listen(POLL_S, ending=True)
            # At the end of an interrupted run it would only say so again.
            with suppress(KeyboardInterrupt) if at_once else nullcontext():
                self._work.poll()
        for number in list(self._members):
            self._members[number].slot.kill()
            self._remove(number, blame=False)

    def _open_slots(self) -> None:
        """Open as many as there are jobs for."""
        free = [
            number
            for number in range(1, self._executor.count + 1)
            if number not in self._members and number not in self._given_up
        ]
        without_job = sum(not one.jobs for one in self._members.values())
        for number in free[: max(0, self._work.left - without_job)]:
            program = self._work.program(number)
            slot = self._executor.open_slot(number, program)
            self._members[number] = _Member(slot, time.monotonic())
            slot.send({"setup": dict(program.setup)})
        if self._work.left and not self._members:
            raise list(self._given_up.values())[-1]

    def _give_jobs(self) -> None:
        for member in self._members.values():
            if not member.wants:
                continue
            job = self._work.take()
            if job is not None:
                member.jobs[self._work.key(job)] = job
                member.wants = member.told_idle = False
                member.slot.send({"job": dict(self._work.describe(job))})
            elif not member.told_idle:
                member.told_idle = True
                member.slot.send({"idle": True})

    def _listen(self, timeout_s: float, *, ending: bool = False) -> None:
        with selectors.DefaultSelector() as selector:
            if not ending:  # then it may be readable for good
                selector.register(self._work, selectors.EVENT_READ)
            for number, member in self._members.items():
                selector.register(member.slot, selectors.EVENT_READ, number)
            ready = [key.data for key, _ in selector.select(timeout_s)]
        for number in filter(None, ready):
            self._hear(number, ending=ending)

    def _hear(self, number: int, *, ending: bool) -> None:
        member = self._members[number]
        try:
            messages = member.slot.read()
        except WorkerLostError as garbled:
            member.slot.kill()
            self._remove(number, blame=not ending, why=garbled.message)
            return
        member.heard_s = time.monotonic()
        for message in messages:
            said = message.get("say")
            if said == "want":
                member.wants, member.told_idle = True, False
            elif said == "done":
                member.jobs.pop(str(message.get("key")), None)
                self._deaths[number] = 0
            elif said == "error":
                error = error_of(message)
                if not isinstance(error, ServerError):
                    if not ending:
                        raise error
                else:  # this place has no server; others may
                    self._given_up[number] = error
            else:
                self._work.on_message(number, message)
        if member.slot.ended:
            self._remove(number, blame=not ending and number not in self._given_up)

    def _remove(self, number: int, *, blame: bool, why: str = "") -> None:
        """Take leave of a slot that has ended, or is to end now."""
        member = self._members.pop(number)
        end = member.slot.close()
        reason = f"Worker {number} is gone: {why or end.reason}"
        if blame:
            self._deaths[number] += 1
            if self._deaths[number] >= _DEATHS:
                self._given_up[number] = WorkerLostError(
                    f"{reason} It has died {_DEATHS} times in a row.", "See its log."
                )
        jobs = list(member.jobs.values())
        self._work.lost(number, jobs, SlotEnd(reason, end.certain), blame=blame)

    def _end_silent(self) -> None:
        for number, member in list(self._members.items()):
            if member.slot.waiting:
                member.heard_s = time.monotonic()
            elif time.monotonic() - member.heard_s > SILENCE_S:
                member.slot.kill()
                self._remove(number, blame=True, why=f"it was silent for {SILENCE_S:.0f} s.")
