"""The server: sockets on one side, the simulation on the other, one thread in between.

:meth:`Server.run` is the simulation thread. It alone touches the world; the socket threads move
bytes, and one more draws pictures of frames that are frozen. In synchronous mode it serves calls
until one of them is a tick. For that it waits until the next frame may begin: the last one is
drawn, or all of it is with a card and the one before is drawn. It waits a second at most while no
other one waits, and not for pictures that nobody has shown to read. Otherwise it ticks by the wall
clock, whatever the pictures take, and serves calls in between.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import math
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from types import TracebackType
from typing import Any

from carstage_sim.freed_memory import give_back_freed_memory
from carstage_sim.simulation import CapturedFrame, Scene, Simulation
from carstage_sim.wire.dialect import Dialect
from carstage_sim.wire.handlers import Call, Session, TickRequest, serve
from carstage_sim.wire.late_pictures import LatePicture, LatePictures
from carstage_sim.wire.payloads import encode_frame, sensor_header
from carstage_sim.wire.relabelling import Relabelling
from carstage_sim.wire.rpc import Disconnected, Event, RpcServer
from carstage_sim.wire.snapshot import encode_snapshot
from carstage_sim.wire.socket_loop import SocketLoop
from carstage_sim.wire.streaming import StreamingServer
from carstage_sim.wire.synchronous_owners import SynchronousOwners
from carstage_sim.wire.traffic_managers import TrafficManagers
from carstage_sim.wire.values import encode_actor, encode_scenery
from carstage_sim.work_thread import Begun
from carstage_sim.world.actors import Actor
from carstage_sim.world.blueprints import sent_as
from carstage_sim.world.snapshot import Snapshot

logger = logging.getLogger(__name__)

_POLL_S = 0.1
_SUBSCRIPTION_POLL_S = 0.005
_SERVED_BETWEEN_TICKS = 256
_LATE_S = 1.0
"""How far fixed steps may lag behind the clock and still make up for it."""
_TIDY_UP_AFTER_S = 2.0
"""After a client is gone; others that go meanwhile are tidied up after with it."""
_RELEASE_AFTER_S = 1.0
"""A program may close one client and go on with another."""
_PATIENCE_S = 1.0
"""How long a tick waits for pictures: many programs give their calls two seconds."""
_MOST_UNDRAWN = 2
"""Frames that may wait to be drawn when a tick has lost its patience."""


class Server:
    """Serves one simulation to any number of clients; a context manager that owns its sockets.

    Args:
        simulation: what is served; its kernels should be warm.
        dialect: protocol version.
        rpc_socket, streaming_socket: bound sockets to accept clients on; the server owns them.
        frames_per_s: pace of the free run.
        pace_hz: most ticks per second in synchronous mode, as a server has that draws; None: no
            bound.
        parent_pid: end when this process is no longer the parent, None to run on.

    Raises:
        PortInUseError: a port is taken.
    """

    def __init__(
        self,
        simulation: Simulation,
        dialect: Dialect,
        *,
        rpc_socket: socket.socket,
        streaming_socket: socket.socket,
        frames_per_s: float,
        pace_hz: float | None = None,
        parent_pid: int | None = None,
    ) -> None:
        self._simulation = simulation
        self._dialect = dialect
        self._relabelled = Relabelling(dialect.labels)
        self._period_s = 1.0 / frames_per_s
        self._shortest_tick_s = 1.0 / pace_hz if pace_hz else 0.0
        self._paced_until_s = 0.0
        self._parent_pid = parent_pid
        self._stop = threading.Event()
        self._next_tick_s = 0.0
        self._owners = SynchronousOwners()
        self._older_streams: list[int] = []
        self._tick_requests: list[TickRequest] = []
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        self._finished: deque[Callable[[], None]] = deque()
        self._undrawn: list[Begun] = []
        self._tidies_up = False
        self._order = itertools.count()
        with ExitStack() as resources:
            rpc_loop = resources.enter_context(SocketLoop("rpc sockets"))
            stream_loop = resources.enter_context(SocketLoop("stream sockets"))
            self._rpc = RpcServer(rpc_loop, rpc_socket)
            self._streams = StreamingServer(stream_loop, streaming_socket)
            resources.callback(self._streams.close)
            self._resources = resources.pop_all()
        self._late = LatePictures(self._streams.taking, self._rpc.wake)
        self.rpc_port = self._rpc.port
        self.streaming_port = self._streams.port
        self._session = Session(
            simulation=simulation,
            dialect=dialect,
            streaming_port=self.streaming_port,
            traffic_managers=TrafficManagers(),
            request_tick=self._tick_requests.append,
            episode_began=self._episode_began,
            after=self._after,
            when_done=self._when_done,
            expect_subscriber=self._streams.expect,
        )

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._resources.close()

    def stop(self) -> None:
        """Let :meth:`run` return soon; safe from signal handlers and other threads."""
        self._stop.set()
        self._streams.close()  # which may be waiting for a client that does not read

    def run(self) -> None:
        """Serve until :meth:`stop`. The calling thread becomes the simulation thread."""
        self._episode_began()
        try:
            self._run()
        finally:
            self._simulation.finish_drawing()  # what is drawn is published here

    def _run(self) -> None:
        while not self._stop.is_set():
            if self._simulation.settings.synchronous_mode:
                self._run_when_told()
            else:
                self._run_freely()
            self._guarded(self._simulation.bakes.advance)
            self._run_due()
            if self._parent_pid is not None and os.getppid() != self._parent_pid:
                logger.info("parent process is gone: ending")
                return

    def _run_when_told(self) -> None:
        if self._waits_for_pictures():
            wait_s = _POLL_S
        elif self._due_requests():
            wait_s = self._paced_until_s - time.monotonic()
        else:
            wait_s = _SUBSCRIPTION_POLL_S if self._tick_requests else _POLL_S
        if wait_s > 0.0:
            self._serve_one(min(wait_s, _POLL_S))
        self._draw_late_unless_a_tick_is_due()
        now_s = time.monotonic()
        if not self._due_requests() or now_s < self._paced_until_s:
            return
        if not self._waits_for_pictures():
            self._paced_until_s = now_s + self._shortest_tick_s
            self._tick()
            self._draw_late_unless_a_tick_is_due()
        elif not self._late.hold_up_the_world:
            self._step_ahead()

    def _draw_late_unless_a_tick_is_due(self) -> None:
        """What is drawn late must not come before the next tick, unless that waits for it."""
        held = bool(self._due_requests()) and not self._late.hold_up_the_world
        self._simulation.hold_late_drawing(held=held)

    def _waits_for_pictures(self) -> bool:
        """Whether the next tick waits for pictures of earlier ones."""
        self._late.asked_by({one.call.connection.number for one in self._due_requests()})
        self._undrawn = [drawn for drawn in self._undrawn if not drawn.done.done()]
        only_sent = len(self._undrawn) == 1 and self._undrawn[0].handed_out.done()
        if not self._undrawn or only_sent or self._late.hold_up_the_world:
            return self._late.hold_up_the_world
        asked_s = min((one.asked_s for one in self._due_requests()), default=math.inf)
        is_patient = time.monotonic() - asked_s < _PATIENCE_S
        return is_patient or len(self._undrawn) >= _MOST_UNDRAWN

    def _due_requests(self) -> list[TickRequest]:
        """Who wants a tick; not those that would miss it, because they subscribe still."""
        waiting = self._tick_requests
        return [one for one in waiting if not self._streams.awaits(one.call.connection)]

    def _run_freely(self) -> None:
        self._simulation.hold_late_drawing(held=False)
        wait_s = self._next_tick_s - time.monotonic()
        if wait_s > 0.0:
            self._serve_one(min(wait_s, _POLL_S))
            return
        # A tick that is always due must not starve the calls.
        for _ in range(_SERVED_BETWEEN_TICKS):
            if not self._serve_one(0.0):
                break
        if not self._simulation.settings.synchronous_mode:
            # A fixed step is as long in simulated time as between two ticks, and late ones follow
            # at once; others take the time that has passed.
            fixed_s, now_s = self._simulation.settings.fixed_delta_seconds, time.monotonic()
            if fixed_s:
                self._next_tick_s = max(self._next_tick_s + fixed_s, now_s - _LATE_S)
            else:
                self._next_tick_s = max(self._next_tick_s + self._period_s, now_s)
            self._tick()

    def _serve_one(self, timeout_s: float) -> bool:
        event = self._rpc.next_event(timeout_s)
        if event is None:
            return False
        self._serve(event)
        return True

    def _serve(self, event: Event) -> None:
        if isinstance(event, Disconnected):
            self._session.traffic_managers.drop_owner(event.connection)
            # Its tick waits for pictures perhaps: it might be made in the next client's episode.
            self._tick_requests[:] = [
                one for one in self._tick_requests if one.call.connection is not event.connection
            ]
            self._tidy_up_soon()
            if self._owners.left(event.connection):
                self._after(_RELEASE_AFTER_S, self._release)
            return
        before, ticks = self._simulation.settings, len(self._tick_requests)
        began_s = time.monotonic()
        serve(self._session, event)
        self._simulation.may_have_changed()
        event.connection.used_s += time.monotonic() - began_s
        self._owners.served(
            event.connection,
            before,
            self._simulation.settings,
            takes_over=event.name == "set_episode_settings" or len(self._tick_requests) > ticks,
        )

    def _tidy_up_soon(self) -> None:
        if not self._tidies_up:
            self._tidies_up = True
            self._after(_TIDY_UP_AFTER_S, self._tidy_up)

    def _tidy_up(self) -> None:
        self._tidies_up = False
        give_back_freed_memory()

    def _release(self) -> None:
        """Let the world run freely again, unless somebody has taken it over meanwhile."""
        if self._simulation.settings.synchronous_mode and not self._owners.owned:
            logger.warning("the client that ticked the world is gone: it runs freely again")
            self._simulation.apply_settings(self._owners.before)
            self._next_tick_s = time.monotonic()

    def _tick(self) -> None:
        """One frame: step, publish the snapshot, answer, then the sensors that look at it.

        The answer must not wait for the sensors: a client that calls while it holds Python's lock
        cannot take their data before it has its answer. Pictures are drawn while calls are served.
        """
        self._streams.begin_frame()
        calls = self._take_due_calls()
        try:
            snapshot = self._simulation.tick()
            self._publish_snapshot(snapshot)
        except Exception as error:  # noqa: BLE001 - told to who asked
            self._fail(calls, error)
            return
        for call in calls:
            call.answer(snapshot.state.frame)
        try:
            self._publish_sensors(snapshot)
        except Exception:
            logger.exception("sensors of frame %d failed", snapshot.state.frame)

    def _step_ahead(self) -> None:
        """Step while pictures are drawn, so that the tick, which waits for them, has less to do.

        Nobody knows of it before: the frame is told, and the calls are answered, by :meth:`_tick`.
        """
        try:
            self._simulation.step_ahead()
        except Exception as error:  # noqa: BLE001 - told to who asked
            self._fail(self._take_due_calls(), error)

    def _take_due_calls(self) -> list[Call]:
        """The calls that wait for the frame which is told now."""
        due = self._due_requests()
        taken = {id(one) for one in due}
        self._tick_requests[:] = [one for one in self._tick_requests if id(one) not in taken]
        return [one.call for one in due if not one.is_answered]

    def _fail(self, calls: Sequence[Call], error: Exception) -> None:
        """Whoever sent what the world cannot bear, the others still want their answers."""
        logger.exception("frame %d failed", self._simulation.world.frame)
        for call in calls:
            call.fail(f"the frame failed in the simulator: {type(error).__name__}: {error}")

    def _publish_snapshot(self, snapshot: Snapshot) -> None:
        payload = encode_snapshot(snapshot, self._dialect, time.time())
        # A client that misses the change of map would keep the old one.
        wait = self._simulation.settings.synchronous_mode or snapshot.map_changed
        for stream_id in self._snapshot_streams():
            self._streams.publish(stream_id, [payload], wait=wait)

    def _snapshot_streams(self) -> list[int]:
        """Streams that carry snapshots: the episode's own, and older ones while somebody listens.

        Where clients open new episodes, each has its own, because the client subscribes to it
        before it gives up the old one, and mixes the two up (and crashes) if they have one number.
        """
        current = self._dialect.episode_stream(self._simulation.world.stream_id)
        self._streams.listeners(current)  # which waits for who is about to subscribe
        older = [i for i in self._older_streams if self._streams.listeners(i) and i != current]
        self._older_streams = [*older, current]
        return self._older_streams

    def _publish_sensors(self, snapshot: Snapshot) -> None:
        scene = self._simulation.scene(
            snapshot, lambda stream_id: self._streams.listeners(stream_id) > 0
        )
        if scene is None:
            return
        wait = self._simulation.settings.synchronous_mode

        def publish(captured: CapturedFrame) -> None:
            self._publish_captured(scene, captured, wait=wait)

        def late_turn(sensor: Actor) -> LatePicture | None:
            return self._late.turn(sensor.stream_id, sensor.client)

        drawn = self._simulation.capture(scene, publish, late_turn if wait else None)
        self._late.begin_frame()
        if drawn is not None:
            self._undrawn.append(drawn)
            for some in drawn:
                some.add_done_callback(lambda _: self._rpc.wake())

    def _publish_captured(self, scene: Scene, captured: CapturedFrame, *, wait: bool) -> None:
        """Send a sensor's data; in any thread of the simulation."""
        state, sensor = scene.state, captured.sensor
        type_id = sent_as(sensor.type_id)
        header = sensor_header(
            self._dialect.sensors.index(type_id), state.frame, state.timestamp_s, captured.pose
        )
        frame = self._relabelled(sensor.type_id, captured.frame)

        def described(actor_id: int, label: int) -> list[Any]:
            """An actor, or with id 0 a part of the town, as this server's clients want it."""
            if not actor_id:
                return encode_scenery(label, self._dialect)
            return encode_actor(scene.actors[actor_id], self._dialect, self._streams.port)

        self._streams.publish(
            sensor.stream_id, [header, *encode_frame(frame, described)], wait=wait
        )

    def _episode_began(self, quiet_s: float = 0.0) -> None:
        self._next_tick_s = time.monotonic() + max(quiet_s, self._period_s)
        self._streams.begin_frame()
        self._publish_snapshot(self._simulation.first_frame())

    def _after(self, delay_s: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._later, (time.monotonic() + delay_s, next(self._order), action))

    def _when_done(self, future: Future[Any], action: Callable[[], None]) -> None:
        def done(_: Future[Any]) -> None:
            self._finished.append(action)
            self._rpc.wake()

        future.add_done_callback(done)

    def _run_due(self) -> None:
        while self._finished:
            self._guarded(self._finished.popleft())
            self._simulation.may_have_changed()
        while self._later and self._later[0][0] <= time.monotonic():
            _, _, action = heapq.heappop(self._later)
            before = self._simulation.settings
            self._guarded(action)
            self._simulation.may_have_changed()
            self._owners.changed(before, self._simulation.settings)

    def _guarded(self, action: Callable[[], None]) -> None:
        """Do work whose result no call waits for; its failure must not end the server."""
        try:
            action()
        except Exception:
            logger.exception("what was to be done between calls failed")
