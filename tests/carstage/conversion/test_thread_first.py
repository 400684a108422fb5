"""Light work is done in a thread, and by processes where that lags behind."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor

import pytest

from carstage.conversion import ThreadFirst
from carstage.errors import ConfigError
from carstage.processes import NICENESS, ProcessPool, process_pool
from waiting import await_that

_DEADLINE_S = 30.0


class Started:
    """Starts pools of one process, and counts them."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> ProcessPool:
        self.count += 1
        return process_pool(1)


@pytest.fixture
def started() -> Started:
    return Started()


@pytest.fixture
def pool(started: Started) -> Iterator[ThreadFirst]:
    with ThreadFirst(started, most_waiting=2) as pool:
        yield pool


def test_work_that_is_kept_up_with_starts_no_process(pool: ThreadFirst, started: Started) -> None:
    for _ in range(10):
        assert pool.submit(os.getpid).result(_DEADLINE_S) == os.getpid()
    assert started.count == 0


def test_a_thread_that_lags_behind_is_helped_by_processes(
    pool: ThreadFirst, started: Started
) -> None:
    goes_on = threading.Event()
    held = [pool.submit(goes_on.wait, _DEADLINE_S) for _ in range(2)]
    elsewhere = [pool.submit(os.getpid).result(_DEADLINE_S) for _ in range(3)]
    assert os.getpid() not in elsewhere
    assert started.count == 1
    goes_on.set()
    assert all(task.result(_DEADLINE_S) for task in held)


def test_the_thread_takes_what_others_leave(pool: ThreadFirst) -> None:
    priority = pool.submit(os.getpriority, os.PRIO_PROCESS, 0).result(_DEADLINE_S)
    assert priority >= NICENESS > os.getpriority(os.PRIO_PROCESS, 0)


def test_an_error_of_a_task_is_its_own(pool: ThreadFirst) -> None:
    with pytest.raises(ConfigError, match="a: wrong"):
        pool.submit(_refuse).result(_DEADLINE_S)
    assert pool.submit(os.getpid).result(_DEADLINE_S) == os.getpid()


def test_killing_begins_no_other_task_and_ends_processes(pool: ThreadFirst) -> None:
    goes_on = threading.Event()
    running, queued = (pool.submit(goes_on.wait, _DEADLINE_S) for _ in range(2))
    await_that(running.running)
    process = pool.submit(time.sleep, _DEADLINE_S)
    await_that(process.running)
    threading.Timer(0.1, goes_on.set).start()
    pool.kill()
    assert running.result(0)
    assert queued.cancelled()
    with pytest.raises(BrokenExecutor):
        process.result(0)
    with pytest.raises(BrokenExecutor):
        pool.submit(os.getpid)


def test_a_thread_that_has_ended_refuses_work(started: Started) -> None:
    pool = ThreadFirst(started)
    pool.kill()
    with pytest.raises(BrokenExecutor):
        pool.submit(os.getpid)
    assert started.count == 0


def test_the_thread_loads_what_work_needs_and_nothing_for_pictures() -> None:
    program = (
        "import sys\n"
        "from carstage.conversion import ThreadFirst\n"
        "with ThreadFirst(None) as pool: pool.submit(bool).result()\n"
        "print(*{'carstage.conversion.segment', 'pyarrow', 'numba', 'PIL', 'pandas',\n"
        "    'carstage.annotation.camera_rows', 'carstage.annotation.object_rows',\n"
        "    'carstage.annotation.pixels', 'carstage.annotation.events'} & {*sys.modules})"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert set(ended.stdout.split()) == {"carstage.conversion.segment", "pyarrow"}


def _refuse() -> None:
    raise ConfigError("a: wrong")
