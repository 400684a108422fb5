"""Threads that give way to the rest of the machine."""

from __future__ import annotations

import logging
import os

NICE = 10
"""A tenth of the weight of others that want the same core, by the kernel's table of weights."""

_log = logging.getLogger(__name__)


def give_way() -> None:
    """Have the calling thread wake nobody off a core, and get less of one that others want.

    Who makes the world, and who ticks it, are served first. Only Linux is known to do this for a
    thread; a container that forbids it leaves all as it was.
    """
    try:
        # Linux takes process 0 for the calling thread: see sched_setscheduler(2), setpriority(2).
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, min(os.getpriority(os.PRIO_PROCESS, 0) + NICE, 19))
    except OSError as error:
        _log.info("a thread cannot give way to others: %s", error)
