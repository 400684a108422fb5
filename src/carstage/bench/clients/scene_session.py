"""What all programs of the comparison do alike: the scene, its sensors, one tick after another.

Each records one episode of a collector's plan with the collector's scene, so that they differ only
in what they are compared for: how data come off the tick and onto the disk.
"""

from __future__ import annotations

import argparse
import queue
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, collector_parser, private_stdout
from carstage.collector.client import connect
from carstage.collector.internals.errors import CollectorError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.plan import Plan, read_plan
from carstage.collector.internals.scene import Scene, build_scene
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.timing import Tick
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, SensorSpec


class SceneSession(NamedTuple):
    """A scene that is ready to be stepped.

    Attributes:
        world: ``carla.World``.
        sensors: those whose files are asked for, by id; not the twins that only labels need.
        folder: where files go: one folder for each sensor.
        timeout_s: how long data of a tick may take.
        listen_from: step of the warm-up from which sensors are listened to.
        on_tick: called with number and frame of the first tick and of the last one.
        afterwards: what is left to do when the scene is gone, in this order.
    """

    world: Any
    scene: Scene
    spec: EpisodeSpec
    sensors: Mapping[str, SensorSpec]
    folder: Path
    timeout_s: float
    listen_from: int
    on_tick: Callable[[int, int], None]
    afterwards: list[Callable[[], object]]

    def warm_up(self, listen: Callable[[], object], settle: Callable[[int], object]) -> int:
        """Make the ticks before the first that counts; returns the last frame.

        Args:
            listen: begins to listen to the sensors.
            settle: waits until all data of a frame have come.
        """
        frame = 0
        for number in range(self.spec.warmup_ticks):
            if number == self.listen_from:
                listen()
            frame = self.scene.step(None).frame
            if number >= self.listen_from:
                settle(frame)
        return frame

    def step(self, tick: int) -> Tick:
        """Make the next tick that counts; the first is reported."""
        made = self.scene.step(tick)
        if tick == 0:
            self.on_tick(tick, made.frame)
        return made

    def path(self, sensor: str, tick: int, suffix: str) -> str:
        """The file of one sensor and tick."""
        return str(self.folder / sensor / f"{tick:06d}{suffix}")


class FrameQueues:
    """A queue for each sensor, as in CARLA's example of the synchronous mode.

    They have no bound, and need none: the next tick is made when this one's data were taken.
    """

    def __init__(self, session: SceneSession) -> None:
        self._timeout_s = session.timeout_s
        self._rig = session.scene.rig
        self._queues: dict[str, Any] = {name: queue.Queue() for name in self._rig.actors}

    def listen(self) -> None:
        """Begin to listen."""
        self._rig.listen({name: one.put for name, one in self._queues.items()})

    def take(self, frame: int) -> dict[str, Any]:
        """The data of a frame by sensor; older ones are dropped.

        Raises:
            CollectorError: a sensor's never came.
        """
        return {name: self._of(name, frame) for name in self._queues}

    def _of(self, name: str, frame: int) -> Any:
        while True:
            try:
                data = self._queues[name].get(timeout=self._timeout_s)
            except queue.Empty:
                raise _late(frame, [name]) from None
            if data.frame == frame:
                return data


class Arrivals:
    """The newest frame that each sensor's callback has finished with.

    Args:
        session: the scene.
    """

    def __init__(self, session: SceneSession) -> None:
        self._timeout_s = session.timeout_s
        self._frames = dict.fromkeys(session.scene.rig.actors, -1)
        self._changed = threading.Condition()

    def done(self, sensor: str, frame: int) -> None:
        """A callback has finished with a frame."""
        with self._changed:
            self._frames[sensor] = frame
            self._changed.notify()

    def wait_for(self, frame: int) -> None:
        """Wait until every sensor's callback has finished with ``frame``.

        Raises:
            CollectorError: one did not.
        """
        with self._changed:
            if not self._changed.wait_for(
                lambda: min(self._frames.values()) >= frame, self._timeout_s
            ):
                late = [sensor for sensor, newest in self._frames.items() if newest < frame]
                raise _late(frame, late)


def _late(frame: int, sensors: list[str]) -> CollectorError:
    return CollectorError(f"Frame {frame} never came from {', '.join(sensors)}.", "Try again.")


@contextmanager
def _scene_session(plan: Plan, events: EventStream, stop: StopRequest) -> Iterator[SceneSession]:
    """The scene of a plan's only episode, before its warm-up.

    Raises:
        CollectorError: the plan or the server does not allow it.
    """
    (episode,) = plan.episodes
    spec = episode.spec
    client = connect(plan.server, stop)
    with WorldSession(client, spec, plan.server.timeout_s) as world_session:
        scene = build_scene(client, world_session, spec=spec, server=plan.server, check=stop.check)
        world_session.on_exit("streams", scene.rig.stop)
        sensors = {sensor.id: sensor for sensor in spec.written_sensors}
        for name in sensors:
            Path(episode.folder, name).mkdir(parents=True, exist_ok=True)
        yield SceneSession(
            world=world_session.world,
            scene=scene,
            spec=spec,
            sensors=sensors,
            folder=Path(episode.folder),
            timeout_s=plan.server.timeout_s,
            listen_from=max(0, spec.warmup_ticks - (plan.sensor_warmup_ticks or spec.warmup_ticks)),
            on_tick=lambda tick, frame: events.tick(
                episode.episode_id, True, tick=tick, frame=frame
            ),
            afterwards=[],
        )


def run_program(
    record: Callable[[SceneSession, argparse.Namespace], Mapping[str, Any] | None],
    description: str | None,
    add_options: Callable[[argparse.ArgumentParser], None] = lambda parser: None,
) -> int:
    """Record the episode of ``PLAN.json``; events and exit codes are the collector's.

    The last event, ``episode_recorded``, holds ``spawned`` and what ``record`` returned.
    """
    parser = collector_parser(description)
    add_options(parser)
    options = parser.parse_args()
    stop = StopRequest()
    stop.on_signals()
    events = EventStream(private_stdout(), stop)
    if options.exit_with_input:
        stop.on_closed_input(sys.stdin.fileno())
    try:
        with _scene_session(read_plan(options.plan), events, stop) as session:
            spawned = session.scene.spawned
            found = record(session, options) or {}
            afterwards = session.afterwards
        for work in afterwards:
            work()
    except (CollectorError, RuntimeError) as error:
        events.emit("error", kind="client", message=str(error), hint="")
        return EXIT_FAILED
    events.emit("episode_recorded", spawned=spawned, **found)
    return EXIT_OK
