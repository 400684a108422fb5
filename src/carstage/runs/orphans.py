"""Processes that a run has started and that outlived it.

Whatever a run starts carries the run's id in its environment, and so does what that starts in turn.
A run that is gone cannot end them; the next one on the dataset does. They end by themselves when
their starter is gone, unless they hang or are held still.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import psutil

RUN_VARIABLE = "CARSTAGE_RUN_ID"
WORKER_VARIABLE = "CARSTAGE_WORKER"
"""Of what one of several workers of a run has started."""
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


def worker_mark(run_id: str, worker: int) -> str:
    """What the environment of a worker's processes holds."""
    return f"{run_id}/{worker}"


def orphans(run_id: str, begun_s: float, variable: str = RUN_VARIABLE) -> list[psutil.Process]:
    """Processes of a run, this one never among them.

    Args:
        run_id: the run's, or what else ``variable`` holds.
        begun_s: Unix time at which the run's own process began; what is older is not the run's.
        variable: of the environment, by which they are known.
    """
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):  # gone meanwhile, or another user's
            if (
                process.pid != os.getpid()
                and process.create_time() >= begun_s - _SLACK_S
                and process.environ().get(variable) == run_id
                and process.status() != psutil.STATUS_ZOMBIE
            ):
                found.append(process)
    return found


def end_orphans_of_worker(run_id: str, worker: int, process: Mapping[str, Any]) -> list[int]:
    """End the processes that a dead worker has left on this machine; returns their ids.

    Args:
        run_id: of its run.
        worker: its number.
        process: which process the run is.
    """
    begun_s = float(process.get("pid_started") or time.time())
    return end_orphans(worker_mark(run_id, worker), begun_s, WORKER_VARIABLE)


def end_orphans(run_id: str, begun_s: float, variable: str = RUN_VARIABLE) -> list[int]:
    """End the processes that a dead run has left; returns their ids. See :func:`orphans`."""
    ended: list[int] = []
    while left := [one for one in orphans(run_id, begun_s, variable) if one.pid not in ended]:
        for process in left:
            ended.append(process.pid)
            with suppress(psutil.Error):
                process.kill()  # psutil looks whether the id is still that process's
        psutil.wait_procs(left, timeout=_END_S)
    return sorted(ended)
