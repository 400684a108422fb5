"""A tick that is stuck behind the Traffic Manager is freed; a slow server is left alone."""

from __future__ import annotations

import socket
import threading
from types import SimpleNamespace

import msgpack
import pytest

from carstage.collector.internals import traffic_manager_wakeup as waking


class TrafficManagerPort:
    """Answers like the Traffic Manager's RPC server and keeps what it was asked."""

    def __init__(self) -> None:
        self.woken = threading.Event()
        self.calls: list[tuple[str, list[bool]]] = []
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

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
                    connection.sendall(msgpack.packb([1, number, None, None]))
        self.woken.set()

    def close(self) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._thread.join()


@pytest.fixture
def traffic_manager() -> TrafficManagerPort:
    return TrafficManagerPort()


class World:
    """Its ticks wait for the Traffic Manager, before or after their frame can be seen."""

    def __init__(self, traffic_manager: TrafficManagerPort, frame_comes: bool) -> None:
        self.frame = 7
        self._woken = traffic_manager.woken
        self._frame_comes = frame_comes

    def get_snapshot(self) -> SimpleNamespace:
        return SimpleNamespace(frame=self.frame)

    def tick(self) -> bool:
        self.frame += self._frame_comes
        return self._woken.wait(20.0 if self._frame_comes else 0.6)


@pytest.mark.parametrize("frame_comes", [True, False])
def test_only_a_tick_whose_frame_has_come_is_freed(
    traffic_manager: TrafficManagerPort, frame_comes: bool
) -> None:
    world = World(traffic_manager, frame_comes)
    watch = waking.TickWatch(world, traffic_manager.port, patience_s=0.1, look_every_s=0.02)
    try:
        with watch.over_a_tick():
            assert world.tick() is frame_comes
    finally:
        watch.stop()
        traffic_manager.close()
    modes = [("set_synchronous_mode", [False]), ("set_synchronous_mode", [True])]
    assert traffic_manager.calls == (modes if frame_comes else [])


def test_a_traffic_manager_that_is_not_there_cannot_be_woken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(ConnectionRefusedError):
        waking.wake_traffic_manager(port)
