"""Record what another program ticks: ``python -m carstage.collector.following PLAN.json``.

It never ticks and changes no setting of the server. It waits for the ego, says what it sees
(``ego_found``), takes the episode's specification as a line of JSON on standard input, attaches
the rig and follows the frames until the ego is gone. Then it waits for the next one. The plan is
fixed in docs/formats/run-folder.md.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import time
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue
from typing import Any, Dict, List, Optional, Set, Tuple

from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, collector_parser, private_stdout
from carstage.collector.client import (
    answers,
    client_version,
    connect,
    is_known_gone,
    versions,
)
from carstage.collector.internals.dialect import check_versions
from carstage.collector.internals.errors import (
    CollectorError,
    ConnectionFailedError,
    InterruptedByRequestError,
    PlanError,
    SceneError,
    client_hint,
    writing_failed,
)
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.followed_episode import FollowedEpisode
from carstage.collector.internals.leaving import leave
from carstage.collector.internals.plan import ServerPlan
from carstage.collector.internals.stopping import StopRequest
from carstage.sensor_kinds import import_plugins, registered_kinds
from carstage.spec import EpisodeSpec, Fields, SpecError

POLL_S = 0.1
SETTLE_S = 5.0
"""So long after the ego appeared the world may become synchronous."""
ANSWER_S = 120.0
"""How long the specification is waited for after ``ego_found``."""

_log = logging.getLogger("carstage.collector")


@dataclass(frozen=True)
class FollowPlan:
    """What is followed.

    Attributes:
        ego: the ego's ``role_name``, its id, or a pattern of blueprints.
        wait_s: how long an ego is waited for.
        episodes: so many are recorded; None: until the server is gone or somebody asks to end.
        folder: where raw logs go, each in a folder ``recorded-N``.
        queue_bytes: sensor data that may wait for the disk; what comes beyond is lost.
    """

    server: ServerPlan
    ego: str
    wait_s: float
    episodes: Optional[int]
    folder: str
    queue_bytes: int
    plugins: Tuple[str, ...]


def read_follow_plan(path: str) -> FollowPlan:
    """Read and check a plan file.

    Raises:
        PlanError: names the field and what is wrong with it.
    """
    try:
        with open(path, encoding="utf-8") as file:
            plan = Fields(json.load(file), "")
        server = plan.object("server")
        return FollowPlan(
            server=ServerPlan(
                server.text("host"),
                server.integer("port", 1, 65535),
                server.number("timeout_s", 0.0),
                server.number("timeout_s", 0.0),
                1,
            ),
            ego=plan.text("ego"),
            wait_s=plan.number("wait_s", 0.0),
            episodes=plan.integer("episodes", 1) if "episodes" in plan else None,
            folder=plan.text("folder"),
            queue_bytes=plan.integer("queue_bytes", 1),
            plugins=plan.words("plugins"),
        )
    except SpecError as error:
        raise PlanError(error.message, error.hint) from error
    except (OSError, ValueError) as error:
        raise PlanError("The plan %s cannot be read: %s." % (path, error)) from error


class Answers:
    """Lines of standard input; its end is a request to end."""

    def __init__(self, stop: StopRequest) -> None:
        self._stop = stop
        self._lines: SimpleQueue[str] = SimpleQueue()
        threading.Thread(target=self._read, name="input", daemon=True).start()

    def take(self, timeout_s: float) -> str:
        """The next line.

        Raises:
            CollectorError: none came.
            InterruptedByRequestError: somebody asked to end.
        """
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            self._stop.check()
            try:
                return self._lines.get(timeout=POLL_S)
            except Empty:
                continue
        raise CollectorError("No specification came for the ego that was found.")

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line)
        self._stop.request("its standard input closed")


class Newcomers:
    """Wakes who waits for an ego as soon as a frame shows actors that the one before did not.

    Each frame that passes until the rig is attached is a frame that is not recorded. A context
    manager.
    """

    def __init__(self) -> None:
        self._world: Optional[Any] = None
        self._callback = 0
        self._seen: Set[int] = set()
        self._came = threading.Event()

    def __enter__(self) -> Newcomers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._world is not None:
            self._world.remove_on_tick(self._callback)

    def look_at(self, world: Any) -> bool:
        """Look at the frames of a world; return whether it is another one than before."""
        if self._world is not None and self._world.id == world.id:
            return False
        # The client forgets the callbacks of a world that is gone.
        self._world, self._callback = world, world.on_tick(self._on_tick)
        return True

    def wait(self, timeout_s: float) -> None:
        """Wait for newcomers, at most so long."""
        self._came.wait(timeout_s)
        self._came.clear()

    def _on_tick(self, snapshot: Any) -> None:
        seen = {int(actor.id) for actor in snapshot}
        if seen - self._seen:
            self._came.set()
        self._seen = seen


class Follower:
    """Waits for egos and records each.

    Args:
        client: ``carla.Client``, connected.
        plan: what is followed.
        events: gets what happens.
        stop: asked between frames.
        answers: where specifications come from.
    """

    def __init__(
        self, client: Any, plan: FollowPlan, events: EventStream, stop: StopRequest, lines: Answers
    ) -> None:
        self._client = client
        self._plan = plan
        self._events = events
        self._stop = stop
        self._lines = lines
        self._done: List[Tuple[int, int]] = []
        self._recorded = 0
        self._versions = versions(client)

    def record_all(self) -> None:
        """Record until enough is recorded, nobody comes any more, or somebody asks to end.

        Raises:
            CollectorError: nobody came at all, the world is not synchronous, the rig does not fit,
            the server is gone.
        """
        while self._plan.episodes is None or self._recorded < self._plan.episodes:
            try:
                found = self._wait_for_ego()
            except InterruptedByRequestError:
                return
            if found is None:
                return
            world, ego = found
            try:
                self._record(world, ego)
            except InterruptedByRequestError:
                return  # before the first frame

    def _record(self, world: Any, ego: Any) -> None:
        part = len(self._done)
        self._events.emit("ego_found", part=part, **self._describe(world, ego))
        line = self._lines.take(ANSWER_S)
        try:
            spec = EpisodeSpec.from_json(json.loads(line), kinds=registered_kinds())
        except SpecError as error:
            raise PlanError(error.message, error.hint) from error
        folder = os.path.join(self._plan.folder, "recorded-%d" % part)
        episode = FollowedEpisode(
            self._client, world, ego, spec, folder, self._plan.server, self._plan.queue_bytes
        )
        self._done.append((world.id, ego.id))
        recorded = episode.record(self._versions, self._events, self._stop)
        self._recorded += bool(recorded.ticks)
        self._events.emit(
            "ego_gone",
            part=part,
            folder=folder,
            ticks=recorded.ticks,
            incomplete=recorded.incomplete,
        )
        if recorded.server_gone:
            raise _server_gone()

    def _wait_for_ego(self) -> Optional[Tuple[Any, Any]]:
        """World and ego, once both are as they must be; None: nobody comes any more."""
        deadline_s = time.monotonic() + self._plan.wait_s
        seen_since_s: Optional[float] = None
        world: Optional[Any] = None
        with Newcomers() as newcomers:
            while True:
                self._stop.check()
                now_s = time.monotonic()
                try:
                    world = self._client.get_world()
                    if newcomers.look_at(world):
                        world.get_map()  # the client keeps it: it is not waited for later
                    ego = self._find(world)
                    settings = world.get_settings()
                except RuntimeError as error:
                    if not answers(self._client, self._plan.server.timeout_s):
                        if self._done and self._plan.episodes is None:
                            _log.info("the server is gone: %s", error)
                            return None
                        raise _server_gone() from error
                    ego = None  # its world is being replaced
                if ego is None:
                    seen_since_s = None
                    if now_s >= deadline_s:
                        if self._done:
                            return None
                        raise self._nobody(world)
                else:
                    seen_since_s = seen_since_s or now_s
                    if settings.synchronous_mode and settings.fixed_delta_seconds:
                        return world, ego
                    if now_s - seen_since_s > SETTLE_S:
                        raise _not_synchronous()
                newcomers.wait(POLL_S)

    def _find(self, world: Any) -> Optional[Any]:
        wanted = self._plan.ego
        # Before the next tick, a new client knows of no actors but those it asks for by id.
        actors = world.get_actors([int(wanted)]) if wanted.isdigit() else world.get_actors()
        if wanted.isdigit():
            found = list(actors)
        elif "." in wanted or "*" in wanted:
            found = list(actors.filter(wanted))
        else:
            found = [a for a in actors if a.attributes.get("role_name") == wanted]
        vehicles = [a for a in found if a.type_id.startswith("vehicle.")]
        fresh = [a for a in vehicles if (world.id, a.id) not in self._done]
        fresh = [a for a in fresh if not is_known_gone(world, a)]
        return min(fresh, key=lambda actor: int(actor.id)) if fresh else None

    def _nobody(self, world: Optional[Any]) -> SceneError:
        if world is None:
            return SceneError(
                "ego: no vehicle %r appeared within %g s." % (self._plan.ego, self._plan.wait_s),
                "The server answers, but tells nothing of its world: look into its log.",
            )
        actors = world.get_actors()
        if not len(actors):
            return SceneError(
                "ego: no vehicle %r appeared within %g s." % (self._plan.ego, self._plan.wait_s),
                "The world made no step meanwhile, and before one a client sees nobody. Let it "
                "step, or give the actor's id, by which it is seen all the same.",
            )
        vehicles = [a for a in actors if a.type_id.startswith("vehicle.")]
        roles = sorted({a.attributes.get("role_name", "") for a in vehicles} - {""})
        seen = "There are %d vehicles" % len(vehicles)
        if roles:
            seen += " of the roles %s" % ", ".join(roles[:8])
        return SceneError(
            "ego: no vehicle %r appeared within %g s." % (self._plan.ego, self._plan.wait_s),
            seen + ". Give a role name, an actor's id, or a pattern such as vehicle.*.",
        )

    def _describe(self, world: Any, ego: Any) -> Dict[str, Any]:
        settings, place = world.get_settings(), ego.get_transform()
        return {
            "id": ego.id,
            "type_id": ego.type_id,
            "role": ego.attributes.get("role_name", ""),
            "map": world.get_map().name.rsplit("/", 1)[-1],
            "client_version": self._versions[0],
            "server_version": self._versions[1],
            "step_s": settings.fixed_delta_seconds,
            "max_substep_delta_time_s": settings.max_substep_delta_time,
            "max_substeps": settings.max_substeps,
            "place": [
                place.location.x,
                place.location.y,
                place.location.z,
                place.rotation.yaw,
            ],
        }


def _server_gone() -> ConnectionFailedError:
    return ConnectionFailedError(
        "The server is gone.", "Look into its log; start it, the program and this command again."
    )


def _not_synchronous() -> SceneError:
    return SceneError(
        "The server is not in synchronous mode with a fixed step: frames that it makes on its own "
        "cannot all be followed.",
        "Have the program set synchronous_mode and fixed_delta_seconds.",
    )


def main(arguments: Optional[List[str]] = None) -> int:
    """Follow as planned; return the exit code.

    0 all that came is recorded, also when somebody asked to end; 1 it failed; 2 bad plan.
    """
    options = collector_parser(main.__doc__).parse_args(arguments)
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
    stop = StopRequest()
    stop.on_signals()
    events = EventStream(private_stdout(), stop)
    code = EXIT_OK
    try:
        plan = read_follow_plan(options.plan)
        import_plugins(plan.plugins)
        _follow(plan, events, stop)
    except CollectorError as error:
        events.emit("error", kind=error.kind, message=error.message, hint=error.hint)
        code = error.exit_code
    except OSError as error:
        failed = writing_failed(error)
        events.emit("error", kind=failed.kind, message=failed.message, hint=failed.hint)
        code = EXIT_FAILED
    except RuntimeError as error:
        _log.exception("the client failed")
        events.emit("error", kind="client", message=str(error), hint=client_hint(error))
        code = EXIT_FAILED
    events.emit("collector_finished", exit_code=code)
    return code


def _follow(plan: FollowPlan, events: EventStream, stop: StopRequest) -> None:
    lines = Answers(stop)
    events.emit("collector_started", pid=os.getpid(), client_version=client_version())
    server = replace(plan.server, timeout_s=min(plan.wait_s, plan.server.timeout_s))
    client = connect(server, stop)
    client.set_timeout(plan.server.timeout_s)
    ends = versions(client)
    check_versions(*ends, [])
    events.emit("connected", server_version=ends[1], map=client.get_world().get_map().name)
    Follower(client, plan, events, stop, lines).record_all()


if __name__ == "__main__":
    leave(main())
