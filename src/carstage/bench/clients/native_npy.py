"""``python -m carstage.bench.clients.native_npy PLAN.json``: ``numpy.save`` in the callback.

What many scripts do with point clouds: the buffer as it came, into one NPY file per sweep.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from carstage.bench.clients.scene_session import Arrivals, SceneSession, run_program

_FLOATS_PER_POINT = 4


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Each callback saves; the next tick is made when all have."""
    arrivals = Arrivals(session)
    first = [sys.maxsize]

    def callback(name: str) -> Callable[[Any], None]:
        def save(data: Any) -> None:
            tick = data.frame - first[0]
            if tick >= 0:
                points = np.frombuffer(data.raw_data, np.float32).reshape(-1, _FLOATS_PER_POINT)
                np.save(session.path(name, tick, ".npy"), points)
            arrivals.done(name, data.frame)

        return save

    callbacks = {name: callback(name) for name in session.scene.rig.actors}
    last = session.warm_up(lambda: session.scene.rig.listen(callbacks), arrivals.wait_for)
    first[0] = last + 1
    for tick in range(session.spec.steps):
        arrivals.wait_for(session.step(tick).frame)


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__)


if __name__ == "__main__":
    sys.exit(main())
