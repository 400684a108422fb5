"""``python -m benchmarks.framework.clients.stream_recorder PLAN.json``: notes sensor messages.

It subscribes to every sensor that another client spawned and writes down, for each message, whose
it was, the frame and the time that it carried, and a digest of its data: what the server sent,
without any of the collector's joining by frames.

The plan: ``host``, ``port``, ``timeout_s``; ``kinds``, the collector's sensor kind by blueprint;
``sensors``, how many there will be; ``journal``, the file that is written.
"""

from __future__ import annotations

import hashlib
import json
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import carla

from benchmarks.framework.journal import DIGEST_BYTES, ENTRY
from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, parse_options, private_stdout
from carstage.collector.internals.errors import CollectorError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.sensors import Sensor, sensor_of

_LOOK_EVERY_S = 0.02


class StreamRecorder:
    """Writes down what comes.

    Args:
        journal: an open file.
    """

    def __init__(self, journal: IO[bytes]) -> None:
        self._journal = journal
        self._lock = threading.Lock()

    def callback(self, actor_id: int, kind: Sensor) -> Callable[[Any], None]:
        """The function to give to ``listen``."""

        def note(data: Any) -> None:
            _, payload = kind.encode(data)
            digest = hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest()
            with self._lock:
                self._journal.write(ENTRY.pack(actor_id, data.frame, data.timestamp, digest))

        return note


def await_sensors(client: Any, count: int, stop: StopRequest, timeout_s: float) -> list[Any]:
    """The sensors that others spawned, once there are ``count``.

    Raises:
        CollectorError: there are not so many in time.
    """
    for _ in range(int(timeout_s / _LOOK_EVERY_S)):
        # A world that was loaded meanwhile has other actors: it is asked for anew each time.
        found = [a for a in client.get_world().get_actors() if a.type_id.startswith("sensor.")]
        if len(found) == count:
            return found
        if stop.wait(_LOOK_EVERY_S):
            break
    raise CollectorError(f"The server never had {count} sensors.", "See the collector's log.")


def main(arguments: list[str] | None = None) -> int:
    """Write down what comes until somebody asks to end."""
    given = parse_options(arguments)
    stop = StopRequest()
    stop.on_signals()
    stop.on_closed_input(sys.stdin.fileno())
    events = EventStream(private_stdout(), stop)
    plan = json.loads(Path(given.plan).read_text("utf-8"))
    client = carla.Client(plan["host"], plan["port"])
    client.set_timeout(plan["timeout_s"])
    with Path(plan["journal"]).open("wb") as journal:
        recorder = StreamRecorder(journal)
        try:
            events.emit("recorder_waits")
            sensors = await_sensors(client, plan["sensors"], stop, plan["timeout_s"])
            for sensor in sensors:
                kind = sensor_of(plan["kinds"][sensor.type_id])
                sensor.listen(recorder.callback(sensor.id, kind))
        except (CollectorError, RuntimeError) as error:
            events.emit("error", kind="client", message=str(error), hint="")
            return EXIT_FAILED
        events.emit("recorder_listens")
        while not stop.wait(plan["timeout_s"]):
            pass
        for sensor in sensors:
            sensor.stop()
    events.emit("episode_recorded")
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
