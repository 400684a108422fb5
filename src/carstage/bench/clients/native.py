"""``python -m carstage.bench.clients.native PLAN.json``: CARLA's own way to save.

The pattern of CARLA's example ``synchronous_mode.py``: a queue for each sensor, one tick, the data
of that tick from each queue, ``save_to_disk`` one after the other. With ``--boxes`` it labels each
frame, too.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from carstage.bench.clients.rows import RowFiles, row_of
from carstage.bench.clients.scene_session import FrameQueues, SceneSession, run_program

POINT_CLOUDS = ("lidar", "semantic_lidar")


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Save every tick before the next is made."""
    boxes = _boxes(session) if options.boxes else None
    queues = FrameQueues(session)
    session.warm_up(queues.listen, queues.take)
    with RowFiles(session.folder) as rows:
        for tick in range(session.spec.steps):
            step = session.step(tick)
            data = queues.take(step.frame)
            for name, sensor in session.sensors.items():
                save(session, name, sensor.kind, tick, data[name], options.format, rows)
            if boxes is not None:
                boxes.add(tick, step.snapshot, data)
    if boxes is not None:
        boxes.write(session.folder)


def save(
    session: SceneSession, name: str, kind: str, tick: int, data: Any, suffix: str, rows: RowFiles
) -> None:
    """One sensor's data of one tick: a picture, a PLY file, or a line of a table."""
    row = row_of(kind, data)
    if row is not None:
        rows.add(name, tick, row)
        return
    data.save_to_disk(session.path(name, tick, ".ply" if kind in POINT_CLOUDS else "." + suffix))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Of this program and of ``native_threads``."""
    parser.add_argument("--format", choices=("png", "tiff", "jpg"), default="png")
    parser.add_argument("--boxes", action="store_true", help="label every frame")


def _boxes(session: SceneSession) -> Any:
    # Needs numpy, which a Python with nothing but the client's wheel need not have.
    from carstage.bench.clients.boxes import Boxes

    return Boxes(session)


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__, add_options)


if __name__ == "__main__":
    sys.exit(main())
