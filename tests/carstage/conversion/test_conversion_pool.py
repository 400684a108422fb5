"""The pool's processes: deaf to Ctrl-C, gone when their parent is gone."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from carstage.conversion import conversion_pool, load_libraries

_DEADLINE_S = 30.0
_PARENT = """
import os, sys, time
from concurrent.futures import wait
from carstage.conversion import conversion_pool

if __name__ == "__main__":
    pool = conversion_pool(2)
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


def test_workers_ignore_an_interrupt_and_die_with_their_parent(
    parent: subprocess.Popen[str],
) -> None:
    pids = workers_of(parent)
    assert pids
    for pid in pids:
        os.kill(pid, signal.SIGINT)
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
    with conversion_pool(1) as pool:
        assert pool.submit(load_libraries, pictures).result(_DEADLINE_S) is None
        assert pool.submit(_has, "carstage.conversion.segment").result(_DEADLINE_S)
        kernel = "carstage.annotation.pixel_kernel"
        assert pool.submit(_has, kernel).result(_DEADLINE_S) is pictures
        assert pool.submit(gc.isenabled).result(_DEADLINE_S)


def _has(module: str) -> bool:
    return module in sys.modules
