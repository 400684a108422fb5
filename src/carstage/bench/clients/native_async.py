"""``python -m carstage.bench.clients.native_async PLAN.json``: saving in the asynchronous mode.

The server runs on its own; every callback saves what it gets. As many frames as the plan has steps
are looked at: how many pictures never came, and how many frames are not whole.
"""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from carstage.bench.clients.native import add_options, save
from carstage.bench.clients.rows import RowFiles
from carstage.bench.clients.scene_session import SceneSession, run_program


class Saved:
    """The frames that each sensor's callback saved, from ``first`` on."""

    def __init__(self, session: SceneSession, suffix: str, rows: RowFiles) -> None:
        self._session = session
        self._suffix = suffix
        self._rows = rows
        self._lock = threading.Lock()
        self._busy = 0
        self._idle = threading.Condition(self._lock)
        self.first: int | None = None
        self.frames: dict[str, set[int]] = {name: set() for name in session.scene.rig.actors}

    def callback(self, name: str) -> Callable[[Any], None]:
        """The function to give to ``listen``."""
        kind = self._session.sensors[name].kind

        def keep(data: Any) -> None:
            with self._lock:
                if (
                    self.first is None
                    or not 0 <= data.frame - self.first < self._session.spec.steps
                ):
                    return
                tick = data.frame - self.first
                self._busy += 1
            try:
                save(self._session, name, kind, tick, data, self._suffix, self._rows)
                self.frames[name].add(tick)
            finally:
                with self._idle:
                    self._busy -= 1
                    self._idle.notify_all()

        return keep

    def end(self) -> None:
        """Save nothing more, and wait until what is being saved is whole."""
        with self._idle:
            self.first = None
            self._idle.wait_for(lambda: self._busy == 0)


def record(session: SceneSession, options: argparse.Namespace) -> Mapping[str, Any]:
    """Save what comes; returns ``lost`` (pictures) and ``torn`` (frames that are not whole)."""
    with RowFiles(session.folder) as rows:
        saved = Saved(session, options.format, rows)
        callbacks = {name: saved.callback(name) for name in session.scene.rig.actors}
        session.warm_up(lambda: session.scene.rig.listen(callbacks), lambda frame: None)
        first = saved.first = session.step(0).frame + 1
        frame = first
        while frame < first + session.spec.steps:
            frame = session.scene.step(0).frame
        saved.end()
        session.scene.rig.stop()
    ticks = range(session.spec.steps)
    have = {tick: sum(tick in frames for frames in saved.frames.values()) for tick in ticks}
    every = len(saved.frames)
    return {
        "lost": sum(every - count for count in have.values()),
        "torn": sum(0 < count < every for count in have.values()),
    }


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__, add_options)


if __name__ == "__main__":
    sys.exit(main())
