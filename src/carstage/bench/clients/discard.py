"""``python -m carstage.bench.clients.discard PLAN.json``: a client that drops everything.

It builds the very scene of the collector, listens to the same sensors and ticks alike, but only
notes which frame came last. What it costs is what any client costs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from carstage.bench.clients.scene_session import Arrivals, SceneSession, run_program


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Make the ticks of the episode, as the collector makes them.

    Events: ``tick`` at the first tick, and at the last one once all its data have come.
    """
    arrivals = Arrivals(session)

    def callback(name: str) -> Callable[[Any], None]:
        return lambda data: arrivals.done(name, data.frame)

    callbacks = {name: callback(name) for name in session.scene.rig.actors}
    session.warm_up(lambda: session.scene.rig.listen(callbacks), arrivals.wait_for)
    frame = 0
    for tick in range(session.spec.steps):
        frame = session.step(tick).frame
    arrivals.wait_for(frame)
    session.on_tick(session.spec.steps - 1, frame)


def main() -> int:
    """Make the ticks of one episode."""
    return run_program(record, __doc__)


if __name__ == "__main__":
    sys.exit(main())
