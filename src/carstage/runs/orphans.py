"""Processes that a run has started and that outlived it.

Whatever a run starts carries the run's id in its environment, and so does what that starts in turn.
A run that is gone cannot end them; the next one on the dataset does. They end by themselves when
their starter is gone, unless they hang or are held still.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import psutil

RUN_VARIABLE = "CARSTAGE_RUN_ID"
_SLACK_S = 1.0
_END_S = 10.0


@contextmanager
def marked(run_id: str) -> Iterator[None]:
    """A stretch in which every process that is started inherits the run's id."""
    before = os.environ.get(RUN_VARIABLE)
    os.environ[RUN_VARIABLE] = run_id
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(RUN_VARIABLE, None)
        else:
            os.environ[RUN_VARIABLE] = before


def orphans(run_id: str, begun_s: float) -> list[psutil.Process]:
    """Processes of a run, this one never among them.

    Args:
        run_id: the run's.
        begun_s: Unix time at which the run's own process began; what is older is not the run's.
    """
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):  # gone meanwhile, or another user's
            if (
                process.pid != os.getpid()
                and process.create_time() >= begun_s - _SLACK_S
                and process.environ().get(RUN_VARIABLE) == run_id
                and process.status() != psutil.STATUS_ZOMBIE
            ):
                found.append(process)
    return found


def end_orphans(run_id: str, begun_s: float) -> list[int]:
    """End the processes that a dead run has left; returns their ids."""
    ended = []
    while left := [process for process in orphans(run_id, begun_s) if process.pid not in ended]:
        for process in left:
            ended.append(process.pid)
            with suppress(psutil.Error):
                process.kill()  # psutil looks whether the id is still that process's
        psutil.wait_procs(left, timeout=_END_S)
    return sorted(ended)
