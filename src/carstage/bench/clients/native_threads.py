"""``python -m carstage.bench.clients.native_threads PLAN.json``: ``save_to_disk`` in threads.

As ``native``, but a pool with a thread for each core saves while the next tick is made: the client
gives Python's lock away while it encodes. At most so many ticks wait as memory should bear.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor

from carstage.bench.clients.native import add_options, save
from carstage.bench.clients.rows import RowFiles
from carstage.bench.clients.scene_session import FrameQueues, SceneSession, run_program

_WAITING_PER_THREAD = 8


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Save every tick in the pool; done when all is saved."""
    queues = FrameQueues(session)
    session.warm_up(queues.listen, queues.take)
    threads = len(os.sched_getaffinity(0))
    room = threading.BoundedSemaphore(threads * _WAITING_PER_THREAD)
    jobs: list[Future[None]] = []
    with RowFiles(session.folder) as rows, ThreadPoolExecutor(threads) as pool:
        for tick in range(session.spec.steps):
            data = queues.take(session.step(tick).frame)
            for name, sensor in session.sensors.items():
                room.acquire()
                job = pool.submit(
                    save, session, name, sensor.kind, tick, data[name], options.format, rows
                )
                job.add_done_callback(lambda _: room.release())
                jobs.append(job)
    for job in jobs:
        job.result()


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__, add_options)


if __name__ == "__main__":
    sys.exit(main())
