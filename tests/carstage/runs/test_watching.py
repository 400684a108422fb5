"""What the watch sees that the collector cannot: a server that hangs, memory that grows."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from carstage.config.supervision import Supervision
from carstage.errors import CollectorError, ServerError
from carstage.runs.watching import AttemptWatch, Limits, resident_bytes
from carstage.server import Endpoint
from driving import wait_for

PLENTY = 1 << 50


class Clock:
    """Time that passes when told to."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Answers:
    """A server's answers to the watch: as many as given, then none."""

    def __init__(self, count: int) -> None:
        self.left = count
        self.asked = 0

    def __call__(self) -> str:
        self.asked += 1
        self.left -= 1
        if self.left < 0:
            raise ServerError("No CARLA server answers: timed out.")
        return "0.9.16"


def watch(
    clock: Clock,
    answers: Answers,
    *,
    hang_s: float = 20.0,
    server: int = PLENTY,
    own: int = PLENTY,
    load: float = 0.0,
) -> AttemptWatch:
    return AttemptWatch(
        Endpoint("127.0.0.1", 2000, 8000, "0.9.16", os.getpid()),
        os.getpid(),
        Limits(hang_s, server, own),
        ask=answers,
        clock_s=clock,
        cpu_s=lambda pid: load * clock.now_s,
    )


def look_for(watching: AttemptWatch, clock: Clock, duration_s: int) -> None:
    for _ in range(duration_s):
        clock.now_s += 1.0
        watching.look()
        if watching.problem is not None:
            return


def test_server_that_answers_is_left_alone() -> None:
    clock, answers = Clock(), Answers(1000)
    watching = watch(clock, answers)
    look_for(watching, clock, 300)
    assert watching.problem is None
    assert answers.asked == 75  # not at every look


def test_server_that_stays_silent_has_hung() -> None:
    clock, answers = Clock(), Answers(2)
    watching = watch(clock, answers)
    look_for(watching, clock, 300)
    assert isinstance(watching.problem, ServerError)
    assert "has not answered for 20 s" in watching.problem.message
    assert "timed out" in watching.problem.message
    assert "supervision.hang_s" in watching.problem.hint


def test_silent_server_that_computes_is_only_slow() -> None:
    clock = Clock()
    watching = watch(clock, Answers(1), load=0.3)
    look_for(watching, clock, 150)
    assert watching.problem is None


def test_silent_server_that_computes_for_ever_has_hung_too() -> None:
    clock = Clock()
    watching = watch(clock, Answers(1), load=0.3)
    look_for(watching, clock, 300)
    assert "has not answered for 20" in str(watching.problem)


def test_answer_in_between_begins_the_silence_anew() -> None:
    clock = Clock()
    watching = watch(clock, Answers(0))
    look_for(watching, clock, 15)
    watching._ask = Answers(1)
    look_for(watching, clock, 15)
    assert watching.problem is None


def test_single_missed_answer_is_no_hang_however_short_the_patience() -> None:
    clock, answers = Clock(), Answers(0)
    watching = watch(clock, answers, hang_s=2.0)
    clock.now_s += 100.0
    watching.look()
    assert watching.problem is None


@pytest.mark.parametrize(
    ("server", "own", "kind", "setting"),
    [
        (1, PLENTY, ServerError, "supervision.server_memory"),
        (PLENTY, 1, CollectorError, "supervision.collector_memory"),
    ],
)
def test_memory_above_its_limit_is_a_problem_that_names_the_setting(
    server: int, own: int, kind: type[Exception], setting: str
) -> None:
    clock = Clock()
    watching = watch(clock, Answers(9), server=server, own=own)
    watching.look()
    assert isinstance(watching.problem, kind)
    assert setting in watching.problem.hint


@pytest.fixture
def child() -> Iterator[subprocess.Popen[bytes]]:
    code = "import sys; x = bytearray(50_000_000); print(len(x), flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process
        process.kill()


def test_memory_counts_what_a_process_has_started(child: subprocess.Popen[bytes]) -> None:
    own = psutil.Process().memory_info().rss
    assert resident_bytes(os.getpid()) > own + 40_000_000
    assert resident_bytes(child.pid) > 40_000_000


def test_process_that_is_gone_holds_nothing() -> None:
    assert resident_bytes(2**22 + 1) == 0


def test_watch_looks_by_itself_and_ends_with_its_context(tmp_path: Path) -> None:
    watching = AttemptWatch(
        Endpoint("127.0.0.1", 2000, 8000, "0.9.16", None),
        os.getpid(),
        Limits(20.0, PLENTY, 1),
        ask=Answers(100),
        look_every_s=0.01,
    )
    with watching:
        assert wait_for(lambda: watching.problem, "the problem", patience_s=30.0)
    assert not watching._thread.is_alive()


def test_watch_names_what_a_probe_raises_by_mistake() -> None:
    def ask() -> str:
        raise ConnectionRefusedError("nobody listens")

    watching = AttemptWatch(
        Endpoint("127.0.0.1", 2000, 8000, "0.9.16", None),
        os.getpid(),
        Limits(0.01, PLENTY, PLENTY),
        ask=ask,
        look_every_s=0.01,
    )
    with watching:
        problem = wait_for(lambda: watching.problem, "the problem", patience_s=30.0)
    assert isinstance(problem, ServerError)
    assert "ConnectionRefusedError: nobody listens" in problem.message


def test_automatic_limits_are_shares_of_the_machine() -> None:
    limits = Limits.of(Supervision(server_memory=64))
    assert limits.server_bytes == 64_000_000
    assert limits.collector_bytes == psutil.virtual_memory().total // 2
