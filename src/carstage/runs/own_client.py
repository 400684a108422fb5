"""``carstage.recording``: record while a block of the caller's own client runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.runs.events import OtherEvent, RunEvent
from carstage.runs.following import DEFAULT_WAIT_S, record_beside
from carstage.runs.outcome import RunResult
from carstage.runs.rig_source import RigSource

_LOOK_S = 0.2


class Recording:
    """What ``recording`` gives; ``result`` is known when its block is over."""

    def __init__(self) -> None:
        self.result: RunResult | None = None


@contextmanager
def recording(
    world: Any,
    ego: Any,
    rig: RigSource,
    out: Path | str,
    *,
    server: str = "localhost:2000",
) -> Iterator[Recording]:
    """Record an ego while the block ticks; one episode.

    The recorder is a process of its own with a client of its own. The block begins when the rig is
    attached; its end waits until the episode is committed.

    Args:
        world: the caller's ``carla.World``, in synchronous mode with a fixed step.
        ego: the ``carla.Vehicle`` that carries the rig.
        rig: a preset's name, a file, or a configuration, as of ``carstage record``.
        out: folder of the dataset, or its place in an object store.
        server: ``HOST:PORT`` of the caller's client, which a world does not tell.

    Raises:
        BadInputError: no server there, or a rig or a world that does not fit.
        CarStageError: recording or committing failed.
    """
    attached, over, stop = threading.Event(), threading.Event(), threading.Event()
    current = Recording()
    failures: list[BaseException] = []

    def on_event(event: RunEvent) -> None:
        if isinstance(event, OtherEvent) and event.name == "following":
            attached.set()

    def record() -> None:
        try:
            current.result = record_beside(
                server,
                str(ego.id),
                rig,
                out,
                on_event,
                wait_s=DEFAULT_WAIT_S,
                episodes=1,
                stop=stop,
            )
        except BaseException as error:  # noqa: BLE001 - raised where the block begins or ends
            failures.append(error)
        finally:
            over.set()

    world.get_settings()  # a world that is gone says so here
    thread = threading.Thread(target=record, name="recording")
    thread.start()
    try:
        while not (attached.wait(_LOOK_S) or over.is_set()):
            pass
        if failures:
            raise failures[0]
        yield current
    finally:
        stop.set()
        thread.join()
    if failures:
        raise failures[0]
