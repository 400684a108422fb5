"""Threads of the recorder beside a program give way to that program and its server."""

from __future__ import annotations

import os
import threading

import pytest

from carstage.collector.internals.background import NICE, give_way


def test_only_the_calling_thread_gives_way() -> None:
    before, found = os.getpriority(os.PRIO_PROCESS, 0), []

    def run() -> None:
        give_way()
        found.append((os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [(min(before + NICE, 19), os.SCHED_BATCH)]
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


def test_a_container_that_forbids_it_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbid(*_: object) -> None:
        raise PermissionError("not here")

    monkeypatch.setattr(os, "sched_setscheduler", forbid)
    give_way()
