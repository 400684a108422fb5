"""The first signal asks, the second ends; nothing is cut where it must not be."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Iterator

import psutil
import pytest

from carstage.runs.interruption import Interruption
from driving import wait_for


def press(number: int = signal.SIGINT) -> None:
    os.kill(os.getpid(), number)


@pytest.fixture
def heard() -> Iterator[None]:
    """Nobody began these tests deaf to the end of a terminal."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_cuts_a_wait(number: int) -> None:
    with Interruption(), pytest.raises(KeyboardInterrupt):
        press(number)


def test_signal_only_wakes_where_it_is_held() -> None:
    said: list[str] = []
    with Interruption(said.append) as interruption:
        with interruption.deferred(), selectors.DefaultSelector() as selector:
            selector.register(interruption, selectors.EVENT_READ)
            press()
            assert selector.select(5.0)
            assert interruption.requested
        with pytest.raises(KeyboardInterrupt):
            interruption.check()
    assert "again" in said[0]


def test_nested_holds_end_with_the_outermost() -> None:
    with Interruption() as interruption:
        with interruption.deferred():
            with interruption.deferred():
                pass
            press()
        assert interruption.requested


def test_handlers_are_restored() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interruption():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before


def test_second_signal_kills_and_leaves() -> None:
    code = """
import os, signal, subprocess, sys
from functools import partial
from carstage.runs.interruption import Interruption
child = subprocess.Popen(["sleep", "120"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
with Interruption() as interruption, interruption.deferred():
    with interruption.kills(partial(os.kill, child.pid, signal.SIGKILL)):
        print(child.pid, flush=True)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        print("not reached")
"""
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 130, ended.stderr
    (pid,) = ended.stdout.split()
    wait_for(lambda: _is_gone(int(pid)), "the end of the child", patience_s=30.0)


def _is_gone(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True
