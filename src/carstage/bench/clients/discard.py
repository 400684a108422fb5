"""``python -m carstage.bench.clients.discard PLAN.json``: a client that drops everything.

It builds the very scene of the collector, listens to the same sensors and ticks alike, but only
notes which frame came last. What it costs is what any client costs.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, parse_options, private_stdout
from carstage.collector.client import connect
from carstage.collector.errors import CollectorError
from carstage.collector.events import EventStream
from carstage.collector.plan import EpisodePlan, Plan
from carstage.collector.reading import read_plan
from carstage.collector.scene import build_scene
from carstage.collector.stopping import StopRequest
from carstage.collector.world import WorldSession


class Newest:
    """The newest frame of each sensor."""

    def __init__(self, sensors: Mapping[str, Any]) -> None:
        self._frames = dict.fromkeys(sensors, -1)
        self._changed = threading.Condition()

    def callback(self, sensor: str) -> Callable[[Any], None]:
        """The function to give to ``listen``."""

        def drop(data: Any) -> None:
            with self._changed:
                self._frames[sensor] = data.frame
                self._changed.notify()

        return drop

    def wait_for(self, frame: int, timeout_s: float) -> None:
        """Wait until every sensor delivered ``frame``.

        Raises:
            CollectorError: one did not.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: min(self._frames.values()) >= frame, timeout_s):
                late = [sensor for sensor, newest in self._frames.items() if newest < frame]
                raise CollectorError(
                    f"Frame {frame} never came from {', '.join(late)}.", "Try again."
                )


def discard(client: Any, plan: Plan, episode: EpisodePlan, events: EventStream) -> None:
    """Make the ticks of one episode, as the collector makes them.

    Events: ``tick`` at the first tick, and at the last one once all its data have come.
    """
    spec, server, stop = episode.spec, plan.server, StopRequest()
    with WorldSession(client, spec, server.timeout_s) as session:
        scene = build_scene(client, session, spec=spec, server=server, check=stop.check)
        newest = Newest(scene.rig.actors)
        session.on_exit("streams", scene.rig.stop)
        begin_listening = max(0, spec.warmup_ticks - (plan.sensor_warmup_ticks or 1))
        frame = 0
        for number in range(spec.warmup_ticks):
            if number == begin_listening:
                scene.rig.listen({sensor: newest.callback(sensor) for sensor in scene.rig.actors})
            frame = scene.step(None).frame
            if number >= begin_listening:
                newest.wait_for(frame, server.timeout_s)
        for tick in range(spec.steps):
            frame = scene.step(tick).frame
            if tick == 0:
                events.tick(episode.episode_id, True, tick=tick, frame=frame)
        newest.wait_for(frame, server.timeout_s)
        events.tick(episode.episode_id, True, tick=spec.steps - 1, frame=frame)


def main(arguments: list[str] | None = None) -> int:
    """Make the ticks of every episode of a plan; the exit codes are the collector's."""
    given = parse_options(arguments)
    stop = StopRequest()
    events = EventStream(private_stdout(), stop)
    try:
        plan = read_plan(given.plan)
        client = connect(plan.server, stop)
        for episode in plan.episodes:
            discard(client, plan, episode, events)
            events.emit("episode_recorded", episode_id=episode.episode_id)
    except (CollectorError, RuntimeError) as error:
        events.emit("error", kind="client", message=str(error), hint="")
        return EXIT_FAILED
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
