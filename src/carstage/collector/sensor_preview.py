"""One look through the sensors of each plan: ``python -m carstage.collector.sensor_preview PLAN``.

For a picture within a moment of asking. The plan is an ordinary one of one episode (see
docs/formats/run-folder.md); further plans come as paths, one per line, on standard input. As long
as nothing but the sensors differs, the world stays as it is: the ego stands where it begins, with
nobody else there. Each look spawns the plan's sensors, makes a step or a few, seals what each saw
as segment 0 of a raw log in the plan's folder, and destroys them. Events: ``looked`` (episode_id,
ticks), or ``error``; ``collector_finished`` at the end, when standard input closes.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import time
from contextlib import ExitStack
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import Any, Callable, Dict, List, Optional, Set, Tuple

from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, private_stdout
from carstage.collector.client import connect
from carstage.collector.ego import spawn_ego
from carstage.collector.internals.errors import (
    CollectorError,
    RecordingError,
    SceneError,
    client_hint,
)
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.leaving import leave
from carstage.collector.internals.plan import EpisodePlan, Plan, read_plan
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.paths import prepare_folder
from carstage.collector.sensors import sensor_of
from carstage.collector.sensors.rig import Rig
from carstage.collector.timing import SynchronousClock
from carstage.collector.world import WorldSession
from carstage.rawlog.format import KIND_DATA
from carstage.rawlog.writing import SegmentWriter
from carstage.spec import EpisodeSpec

SETTLING_TICKS = 2
"""Steps after loading: the ego comes to rest on its wheels."""
MOST_TICKS = 8
"""Steps within which a sensor must have measured: optical flow needs two."""
TICK_PATIENCE_S = 0.5
"""How long the data of a step are waited for before the next one: a stream needs a moment."""

OTHERS = ("vehicle", "walker", "controller", "sensor")
"""Actors that are there only where somebody has put them."""

_log = logging.getLogger("carstage.collector")


def main(arguments: Optional[List[str]] = None) -> int:
    """Look until standard input closes; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m carstage.collector.sensor_preview", description=__doc__
    )
    parser.add_argument("plan", help="the first plan, JSON")
    parser.add_argument("--exit-with-input", action="store_true", help="always so")
    options = parser.parse_args(arguments)
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
    stop = StopRequest()
    stop.on_signals()  # what was borrowed is given back first
    events = EventStream(private_stdout(), stop)
    code = EXIT_OK
    with ExitStack() as stack:
        viewer: Optional[Viewer] = None
        paths = [options.plan]
        while paths and not stop.requested:
            try:
                plan = read_plan(paths.pop())
                if viewer is None:
                    viewer = Viewer(connect(plan.server, stop), stop)
                    stack.callback(viewer.close)
                ticks = viewer.look(plan)
                events.emit("looked", episode_id=plan.episodes[0].episode_id, ticks=ticks)
            except CollectorError as error:
                events.emit("error", kind=error.kind, message=error.message, hint=error.hint)
            except (RuntimeError, OSError) as error:
                _log.exception("a look failed")
                hint = client_hint(error) if isinstance(error, RuntimeError) else ""
                events.emit("error", kind="client", message=str(error), hint=hint)
                code = EXIT_FAILED
                break  # the server is gone, or the disk is full: whoever started this starts anew
            line = sys.stdin.readline()
            paths = [line.strip()] if line.strip() else []
    events.emit("collector_finished", exit_code=code)
    return code


class Viewer:
    """One world at a time, looked at through sensors that come and go.

    Args:
        client: ``carla.Client``, connected.
        stop: asked between steps.
    """

    def __init__(self, client: Any, stop: StopRequest) -> None:
        self._client = client
        self._stop = stop
        self._shared = False
        #: Actors of this world that are ours, or were: sensors go with the step after a look.
        self._mine: Set[int] = set()
        self._shown: Optional[EpisodeSpec] = None
        self._world = ExitStack()
        self._session: Any = None
        self._ego: Any = None
        self._clock: Any = None

    def look(self, plan: Plan) -> int:
        """Record one frame of each sensor of a plan's first episode; return the steps it took.

        Raises:
            CollectorError: the server cannot make the scene, or a sensor gave nothing.
            RuntimeError: the server stopped answering.
        """
        episode = plan.episodes[0]
        scene = replace(episode.spec, sensors=())
        self._shared = plan.server.shared
        if self._shared:
            self._refuse_if_used()
        if scene != self._shown:
            self.close()
            self._load(plan, episode)
            self._shown = scene
        return self._record(episode)

    def close(self) -> None:
        """Give the world back; what others have taken over meanwhile is theirs."""
        session, self._session = self._session, None
        self._shown = None
        self._mine.clear()
        if self._shared and session is not None:
            try:
                session.leave_to_others()
            except RuntimeError as error:
                _log.warning("nobody knows whether others use the server: %s", error)
        self._world.close()

    def _refuse_if_used(self) -> None:
        """Look at the server before touching it.

        Raises:
            SceneError: somebody else uses it; what was ours is given back.
        """
        world = self._client.get_world()
        ours = self._session is not None and world.id == self._session.world.id
        mine = self._mine if ours else ()
        others = [
            actor.type_id
            for actor in world.get_actors()
            if actor.type_id.split(".")[0] in OTHERS and actor.id not in mine
        ]
        reason = ""
        if others:
            reason = "%d actors of others are there, such as %s" % (len(others), others[0])
        elif world.get_settings().synchronous_mode and not ours:
            reason = "another client steps it"
        if not reason:
            return
        self.close()
        raise SceneError(
            "The server is used by somebody else: %s." % reason,
            "Look through the sensor when they have finished, or choose another server.",
        )

    def _load(self, plan: Plan, episode: EpisodePlan) -> None:
        server = plan.server
        self._session = self._world.enter_context(
            WorldSession(self._client, episode.spec, server.timeout_s, server.load_timeout_s)
        )
        self._ego = spawn_ego(self._session, episode.spec)
        self._mine.add(self._ego.id)
        self._clock = SynchronousClock(self._session.world, server.timeout_s)
        for _ in range(SETTLING_TICKS):
            self._stop.check()
            self._clock.step()

    def _record(self, episode: EpisodePlan) -> int:
        passing = _Passing(self._session)
        try:
            rig = Rig(passing, episode.spec, self._ego)  # type: ignore[arg-type]
            self._mine.update(actor.id for actor in rig.actors.values())
            data, ticks = self._wait(rig)
        finally:
            passing.give_back()
        folder = prepare_folder(episode.folder)
        for sensor in episode.spec.sensors:
            datum = data[sensor.id]
            meta, payload = sensor_of(sensor.kind).encode(datum)
            stream = os.path.join(folder, sensor.id)
            os.mkdir(stream)
            with SegmentWriter(stream, sensor.id, 0) as writer:
                writer.append(KIND_DATA, 0, datum.frame, datum.timestamp, meta, payload)
                writer.seal(0, 0)
        return ticks

    def _wait(self, rig: Rig) -> Tuple[Dict[str, Any], int]:
        """Step until every sensor has given data; the newest of each."""
        inbox: SimpleQueue[Tuple[str, Any]] = SimpleQueue()

        def callback(name: str) -> Callable[[Any], None]:
            return lambda datum: inbox.put((name, datum))

        rig.listen({name: callback(name) for name in rig.actors})
        data: Dict[str, Any] = {}
        try:
            for tick in range(MOST_TICKS):
                self._stop.check()
                self._clock.step()
                deadline_s = time.monotonic() + TICK_PATIENCE_S
                while len(data) < len(rig.actors):
                    try:
                        name, datum = inbox.get(timeout=max(0.0, deadline_s - time.monotonic()))
                    except Empty:
                        break
                    data[name] = datum
                if len(data) == len(rig.actors):
                    return data, tick + 1
        finally:
            rig.stop()
        missing = sorted(set(rig.actors) - set(data))
        raise RecordingError(
            "Nothing came from %s in %d steps." % (", ".join(missing), MOST_TICKS),
            "Look at the server's log.",
        )


class _Passing:
    """What a rig needs of a session, for a rig that goes before the session does."""

    def __init__(self, session: WorldSession) -> None:
        self.world = session.world
        self._session = session
        self._actors: List[Any] = []

    def destroy_on_exit(self, what: str, actor: Any) -> None:
        """Have an actor destroyed by ``give_back``."""
        del what
        self._actors.append(actor)

    def give_back(self) -> None:
        """Destroy the actors."""
        import carla

        commands = [carla.command.DestroyActor(actor.id) for actor in reversed(self._actors)]
        self._actors.clear()
        if commands:
            self._session.client.apply_batch_sync(commands, False)


if __name__ == "__main__":
    leave(main())
