"""A tick that is stuck behind the Traffic Manager is freed; a slow one is left alone."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import msgpack
import pytest

from carstage.collector.internals import traffic_manager_wakeup as waking
from carstage.collector.internals.errors import RecordingError
from carstage.collector.timing import SynchronousClock

STEP_CPU_S = 0.02
"""CPU time of a step of the Traffic Manager here."""
GIVE_UP_S = 20.0


def burn(cpu_s: float) -> None:
    """Use CPU time in this thread."""
    end_s = time.thread_time() + cpu_s
    while time.thread_time() < end_s:
        pass


class TrafficManager:
    """A thread that makes steps, and a port that answers as the client's Traffic Manager does.

    Args:
        wake: what the thread does between the two answers of a wake-up.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None) -> None:
        self.calls: list[tuple[str, list[bool]]] = []
        self.woken = threading.Event()
        self._wake = wake
        self._work: Callable[[], None] | None = None
        self._change = threading.Condition()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._answering = threading.Thread(target=self._serve, daemon=True)
        self._answering.start()
        with waking.started_threads() as self.threads:
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def do(self, work: Callable[[], None]) -> None:
        """Have the thread do something; returns when it is done."""
        with self._change:
            self._work = work
            self._change.notify_all()
            assert self._change.wait_for(lambda: self._work is None, GIVE_UP_S)

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._work is not None)
                work = self._work
            assert work is not None
            work()
            with self._change:
                self._work = None
                self._change.notify_all()

    def _serve(self) -> None:
        try:
            connection, _ = self._server.accept()
        except OSError:  # closed before anybody came
            return
        unpacker = msgpack.Unpacker()
        with connection:
            while len(self.calls) < 2:
                unpacker.feed(connection.recv(4096))
                for _, number, name, arguments in unpacker:
                    self.calls.append((name, arguments))
                    if number == 1:
                        self.do(self._wake)
                    connection.sendall(msgpack.packb([1, number, None, None]))
        self.woken.set()

    def close(self) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._answering.join()


class World:
    """Frames that come at once, and a server that may be too busy to answer."""

    def __init__(self) -> None:
        self.frame = 7
        self.answers = True

    def get_snapshot(self) -> SimpleNamespace:
        return SimpleNamespace(frame=self.frame)

    def get_settings(self) -> None:
        if not self.answers:
            raise RuntimeError("time-out of 20000ms while waiting for the simulator")


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def manager(request: pytest.FixtureRequest) -> Iterator[TrafficManager]:
    made = TrafficManager(getattr(request, "param", lambda: None))
    yield made
    made.close()


@pytest.fixture
def watch(world: World, manager: TrafficManager) -> Iterator[waking.TickWatch]:
    made = waking.TickWatch(world, manager.port, manager.threads, 0.1, 0.02)
    for _ in range(3):
        with made.over_a_tick():
            world.frame += 1
            manager.do(lambda: burn(STEP_CPU_S))
    yield made
    made.stop()


def tick_until_woken(
    watch: waking.TickWatch,
    world: World,
    manager: TrafficManager,
    step: Callable[[], None] = lambda: None,
) -> None:
    """A tick that returns when the Traffic Manager, which did ``step``, was woken."""
    with watch.over_a_tick():
        world.frame += 1
        step()
        assert manager.woken.wait(GIVE_UP_S)


WAKE_UP = [("set_synchronous_mode", [False]), ("set_synchronous_mode", [True])]


def test_a_step_that_never_began_is_woken_and_nothing_changes(
    world: World, manager: TrafficManager, watch: waking.TickWatch
) -> None:
    tick_until_woken(watch, world, manager)
    assert manager.calls == WAKE_UP
    assert (watch.wake_ups, watch.changed) == (1, False)


def test_a_step_whose_end_was_missed_is_woken_and_given_up(
    world: World, manager: TrafficManager, watch: waking.TickWatch
) -> None:
    tick_until_woken(watch, world, manager, lambda: manager.do(lambda: burn(STEP_CPU_S)))
    assert manager.calls == WAKE_UP
    assert watch.changed


@pytest.mark.parametrize("manager", [lambda: burn(STEP_CPU_S)], indirect=True)
def test_a_step_that_may_have_ended_outside_synchronous_mode_is_given_up(
    world: World, manager: TrafficManager, watch: waking.TickWatch
) -> None:
    tick_until_woken(watch, world, manager)
    assert watch.changed


def test_a_traffic_manager_that_works_is_left_alone(
    world: World, manager: TrafficManager, watch: waking.TickWatch
) -> None:
    with watch.over_a_tick():
        world.frame += 1
        manager.do(lambda: burn(0.6))
    assert manager.calls == []


def test_a_server_that_has_not_answered_is_waited_for(
    world: World, manager: TrafficManager, watch: waking.TickWatch
) -> None:
    world.answers = False
    with watch.over_a_tick():
        world.frame += 1
        assert not manager.woken.wait(0.6)
    assert manager.calls == []


def test_a_frame_that_has_not_come_is_the_servers_business(
    manager: TrafficManager, watch: waking.TickWatch
) -> None:
    with watch.over_a_tick():
        assert not manager.woken.wait(0.6)
    assert manager.calls == []


def test_without_known_threads_every_wake_up_counts(world: World, manager: TrafficManager) -> None:
    watch = waking.TickWatch(world, manager.port, (), 0.1, 0.02)
    tick_until_woken(watch, world, manager)
    assert watch.changed
    watch.stop()


def test_a_recording_ends_after_a_doubtful_wake_up(world: World, manager: TrafficManager) -> None:
    def tick(_timeout_s: float) -> int:
        world.frame += 1
        assert manager.woken.wait(GIVE_UP_S)
        return world.frame

    world.tick = tick  # type: ignore[attr-defined]
    watch = waking.TickWatch(world, manager.port, (), 0.1, 0.02)
    with pytest.raises(RecordingError, match="missed its cue before frame 8"):
        SynchronousClock(world, 1.0, watch).step()
    watch.stop()


def test_a_traffic_manager_that_is_not_there_cannot_be_woken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(ConnectionRefusedError):
        waking.wake_traffic_manager(port)
