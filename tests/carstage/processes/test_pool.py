"""The pool's processes: deaf to Ctrl-C, gone when their parent is gone."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

import psutil
import pytest

from carstage.conversion import import_libraries
from carstage.errors import ConfigError
from carstage.processes import process_pool
from waiting import await_that

_DEADLINE_S = 30.0
_PARENT = """
import os, sys, time
from concurrent.futures import wait
from carstage.processes import process_pool

pool = process_pool(2)
for _ in sys.stdin:
    wait([pool.submit(time.sleep, 0.1) for _ in range(2)])
    print(*sorted({pool.submit(os.getpid).result() for _ in range(20)}), flush=True)
"""


def workers_of(parent: subprocess.Popen[str]) -> list[int]:
    """Let the parent's pool work; the processes that did."""
    assert parent.stdin is not None
    assert parent.stdout is not None
    parent.stdin.write("work\n")
    parent.stdin.flush()
    return [int(pid) for pid in parent.stdout.readline().split()]


@pytest.fixture
def parent(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    script = tmp_path / "parent.py"
    script.write_text(_PARENT)
    process = subprocess.Popen(
        [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    yield process
    process.kill()
    process.wait()
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    process.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP, signal.SIGTERM])
def test_workers_ignore_signals_and_die_with_their_parent(
    parent: subprocess.Popen[str], number: signal.Signals
) -> None:
    pids = workers_of(parent)
    assert pids
    for pid in pids:
        os.kill(pid, number)
    assert set(workers_of(parent)) & set(pids)
    workers = [psutil.Process(pid) for pid in pids]
    assert all(worker.nice() > 0 for worker in workers)
    parent.kill()
    parent.wait()
    gone, alive = psutil.wait_procs(workers, timeout=_DEADLINE_S)
    assert not alive
    assert len(gone) == len(workers)


@pytest.mark.parametrize("pictures", [True, False])
def test_workers_load_what_a_segment_needs_before_there_is_one(pictures: bool) -> None:
    with process_pool(1) as pool:
        assert pool.submit(import_libraries, pictures).result(_DEADLINE_S) is None
        assert pool.submit(_has, "carstage.conversion.segment").result(_DEADLINE_S)
        kernel = "carstage.annotation.pixel_kernel"
        assert pool.submit(_has, kernel).result(_DEADLINE_S) is pictures
        assert pool.submit(gc.isenabled).result(_DEADLINE_S)


@pytest.mark.parametrize("pictures", [True, False])
def test_libraries_are_loaded_once_by_a_process_without_threads(pictures: bool) -> None:
    preload = (import_libraries, (pictures,))
    with process_pool(3, preload=preload) as pool:
        sleeping = [pool.submit(time.sleep, 0.2) for _ in range(3)]
        assert all(task.result(_DEADLINE_S) is None for task in sleeping)
        parents = {pool.submit(os.getppid).result(_DEADLINE_S) for _ in range(9)}
        assert len(parents) == 1
        (parent,) = (psutil.Process(pid) for pid in parents)
        assert parent.num_threads() == 1
        assert pool.submit(_has, "carstage.conversion.segment").result(_DEADLINE_S)
        # It was loaded before the fork: the worker itself has read no file of ours.
        worker = psutil.Process(pool.submit(os.getpid).result(_DEADLINE_S))
        assert worker.ppid() == parent.pid
        assert worker.cpu_times().user < parent.cpu_times().user / 2


def test_pool_forks_no_more_workers_than_work_needs() -> None:
    with process_pool(8) as pool:
        pids = {pool.submit(os.getpid).result(_DEADLINE_S) for _ in range(20)}
        (parent,) = {pool.submit(os.getppid).result(_DEADLINE_S)}
        assert len(pids) == len(psutil.Process(parent).children()) <= 2


def test_a_pool_whose_libraries_cannot_be_loaded_refuses_work() -> None:
    with process_pool(2, preload=(_raise, (ValueError("no such library"),))) as pool:
        with pytest.raises(BrokenExecutor):
            pool.submit(os.getpid).result(_DEADLINE_S)
        with pytest.raises(BrokenExecutor):
            pool.submit(os.getpid)


def test_killing_a_pool_that_still_loads_does_not_wait() -> None:
    pool = process_pool(1, preload=(time.sleep, (_DEADLINE_S,)))
    waiting = pool.submit(os.getpid)
    await_that(waiting.running)
    began = time.monotonic()
    pool.kill()
    assert time.monotonic() - began < _DEADLINE_S / 2
    with pytest.raises(BrokenExecutor):
        waiting.result(0)


def test_workers_end_with_the_process_that_they_are_forked_from() -> None:
    with process_pool(2) as pool:
        worker = psutil.Process(pool.submit(os.getpid).result(_DEADLINE_S))
        sleeping = pool.submit(time.sleep, _DEADLINE_S)
        await_that(sleeping.running)
        psutil.Process(pool.submit(os.getppid).result(_DEADLINE_S)).kill()
        with pytest.raises(BrokenExecutor):
            sleeping.result(_DEADLINE_S)
        _, alive = psutil.wait_procs([worker], timeout=_DEADLINE_S)
        assert not alive


def test_killing_ends_tasks_in_the_middle_and_begins_no_other() -> None:
    pool = process_pool(1)
    pid = pool.submit(os.getpid).result(_DEADLINE_S)
    sleeping, queued = (pool.submit(time.sleep, _DEADLINE_S) for _ in range(2))
    await_that(sleeping.running)
    pool.kill()
    assert not psutil.pid_exists(pid)
    with pytest.raises(BrokenExecutor):
        sleeping.result(0)
    assert queued.cancelled()
    with pytest.raises(BrokenExecutor):
        pool.submit(os.getpid)


def test_worker_that_dies_breaks_the_pool_and_ends_the_others() -> None:
    with process_pool(2) as pool:
        sleeping = pool.submit(time.sleep, _DEADLINE_S)
        with pytest.raises(BrokenExecutor):
            pool.submit(os._exit, 1).result()
        with pytest.raises(BrokenExecutor):
            sleeping.result(_DEADLINE_S)
        with pytest.raises(BrokenExecutor):
            pool.submit(os.getpid)


def test_error_of_a_task_is_raised_with_the_place_where_it_happened() -> None:
    with process_pool(1) as pool:
        with pytest.raises(ConfigError, match="a: wrong") as caught:
            pool.submit(_raise, ConfigError("a: wrong", "hint", ((("a",), "wrong", ""),))).result()
        assert caught.value.problems == ((("a",), "wrong", ""),)
        assert "in _raise" in str(caught.value.__cause__)
        with pytest.raises(RuntimeError, match="_TakesTwo: both"):
            pool.submit(_raise_with_two).result()
        assert pool.submit(os.getpid).result()


def test_task_that_is_defined_in_the_program_itself_is_refused_with_a_way_out() -> None:
    program = (
        "from carstage.processes import process_pool\n"
        "def task(): pass\n"
        "with process_pool(1) as pool:\n"
        "    error = pool.submit(task).exception()\n"
        "    print(type(error).__name__, error.hint, pool.submit(len, 'abc').result())\n"
    )
    answer = subprocess.run([sys.executable], input=program, capture_output=True, text=True)
    assert answer.stdout.startswith("BadInputError Define it in a module"), answer.stderr
    assert answer.stdout.endswith(" 3\n")


def test_who_hands_out_the_work_does_not_load_what_it_needs() -> None:
    others = "{'pyarrow', 'PIL', 'numba', 'carstage.annotation', 'carstage.dataset.reading'}"
    program = f"import sys, carstage.runs.running; print(*{others} & {{*sys.modules}})"
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == []


def test_what_only_some_labels_need_is_loaded_for_pictures_alone() -> None:
    some = ["birds_eye", "lane_lines", "occupancy", "conversion.disparity", "conversion.patches"]
    wanted = f"{{*{[f'carstage.{name}' for name in some]}, 'PIL'}}"
    for pictures in (True, False):
        program = (
            "import sys; from carstage.conversion import import_libraries; "
            f"import_libraries({pictures}); print(*{wanted} & {{*sys.modules}})"
        )
        ended = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        )
        assert len(ended.stdout.split()) == (len(some) + 1) * pictures


def test_workers_load_no_configuration() -> None:
    others = "{'pydantic', 'yaml', 'duckdb', 'carstage.config', 'carstage.dataset.reading'}"
    program = f"import sys, carstage.conversion.segment; print(*{others} & {{*sys.modules}})"
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == []


class _TakesTwo(Exception):  # noqa: N818
    """Can be pickled, but not made again."""

    def __init__(self, message: str, number: int) -> None:
        super().__init__(message)


def _raise(error: Exception) -> None:
    raise error


def _raise_with_two() -> None:
    raise _TakesTwo("both", 2)


def _has(module: str) -> bool:
    return module in sys.modules
