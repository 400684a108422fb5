"""``python -m carstage.bench.clients.pillow PLAN.json``: pictures by NumPy and Pillow.

As ``native``, but with the lines that tutorials have: the buffer as an array, its first three
channels turned round, ``Image.fromarray(...).save(...)``.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from PIL import Image

from carstage.bench.clients.scene_session import FrameQueues, SceneSession, run_program


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Save every tick before the next is made."""
    queues = FrameQueues(session)
    session.warm_up(queues.listen, queues.take)
    for tick in range(session.spec.steps):
        data = queues.take(session.step(tick).frame)
        for name in session.sensors:
            image = data[name]
            array = np.frombuffer(image.raw_data, dtype=np.uint8)
            array = array.reshape((image.height, image.width, 4))[:, :, :3][:, :, ::-1]
            Image.fromarray(array).save(session.path(name, tick, ".png"))


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__)


if __name__ == "__main__":
    sys.exit(main())
