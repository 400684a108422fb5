"""The watched clock wakes a Traffic Manager that missed its cue, and only then."""

from __future__ import annotations

import socket
import threading
from dataclasses import dataclass, field

import msgpack
import pytest

from benchmarks.simulator.ticking import WatchedClock, wake_traffic_manager

WAIT_S = 20.0


@dataclass
class Snapshot:
    frame: int


@dataclass
class Oversleeper:
    """A world whose tick returns only after it was woken.

    Args:
        frame_comes: whether the new frame is seen before the wait, as in the real defect.
    """

    frame_comes: bool
    frame: int = 7
    woken: threading.Event = field(default_factory=threading.Event)

    def get_snapshot(self) -> Snapshot:
        return Snapshot(self.frame)

    def tick(self) -> int:
        if self.frame_comes:
            self.frame += 1
        self.woken.wait(1.0 if not self.frame_comes else WAIT_S)
        return self.frame


def watched(sleeper: Oversleeper) -> WatchedClock:
    return WatchedClock(sleeper, sleeper.woken.set, patience_s=0.1)


def test_a_missed_cue_is_made_up_for() -> None:
    sleeper = Oversleeper(frame_comes=True)
    with watched(sleeper) as clock:
        assert clock.tick() == 8
        assert clock.wake_ups == 1


def test_a_server_that_takes_long_for_a_frame_is_left_alone() -> None:
    sleeper = Oversleeper(frame_comes=False)
    with watched(sleeper) as clock:
        clock.tick()
        assert clock.wake_ups == 0
    assert not sleeper.woken.is_set()


def test_waking_leaves_synchronous_mode_and_returns_to_it_in_one_breath() -> None:
    calls = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            unpacker = msgpack.Unpacker()
            with connection:
                while len(calls) < 2:
                    unpacker.feed(connection.recv(4096))
                    for kind, number, name, arguments in unpacker:
                        calls.append((kind, name, arguments))
                        connection.sendall(msgpack.packb([1, number, None, None]))

        thread = threading.Thread(target=answer)
        thread.start()
        wake_traffic_manager(server.getsockname()[1])
        thread.join()
    assert calls == [(0, "set_synchronous_mode", [False]), (0, "set_synchronous_mode", [True])]


def test_nobody_to_wake_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(ConnectionRefusedError):
        wake_traffic_manager(port)
