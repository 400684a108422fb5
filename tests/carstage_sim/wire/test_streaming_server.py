from __future__ import annotations

import errno
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from carstage_sim.wire import socket_loop, streaming
from carstage_sim.wire.channel import Channel
from carstage_sim.wire.errors import PortInUseError
from carstage_sim.wire.socket_loop import SocketLoop, bind
from carstage_sim.wire.streaming import LONGEST_WAIT_S, StreamingServer, Taking
from raw_client import read_bytes, read_message, subscribe
from waiting import await_that

STREAM = 7
LARGE = 32 << 20  # more than any socket buffer takes
_RECEIVED_SLOWLY_BYTES = 1 << 20


@pytest.fixture
def server() -> Iterator[StreamingServer]:
    with SocketLoop("test") as loop:
        streaming = StreamingServer(loop, bind("127.0.0.1", 0))
        yield streaming
        streaming.close()


@pytest.fixture
def subscribers(server: StreamingServer) -> Iterator[Callable[[], socket.socket]]:
    with ExitStack() as opened:

        def connect() -> socket.socket:
            before = server.listeners(STREAM)
            connection = opened.enter_context(subscribe("127.0.0.1", server.port, STREAM))
            await_listeners(server, before + 1)
            return connection

        yield connect


def await_listeners(server: StreamingServer, count: int) -> None:
    await_that(lambda: server.listeners(STREAM) == count)


@pytest.mark.parametrize("sizes", [[1], [4, 0, 9], [1] * 200, [LARGE, 3]])
def test_message_arrives_whole_whatever_its_parts(
    server: StreamingServer, subscribers: Callable[[], socket.socket], sizes: list[int]
) -> None:
    connection = subscribers()
    parts = [bytes([index % 251]) * size for index, size in enumerate(sizes)]
    server.publish(STREAM, parts, wait=True)
    assert read_message(connection) == b"".join(parts)


def test_message_goes_to_every_subscriber_of_its_stream_and_to_no_other(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    first, second = subscribers(), subscribers()
    server.publish(STREAM + 1, [b"other"], wait=True)
    server.publish(STREAM, [b"mine"], wait=True)
    assert (read_message(first), read_message(second)) == (b"mine", b"mine")


def test_a_subscriber_that_is_expected_is_waited_for(server: StreamingServer) -> None:
    server.expect(STREAM)
    with ExitStack() as opened:
        late = threading.Timer(
            0.02,
            lambda: opened.enter_context(subscribe("127.0.0.1", server.port, STREAM)),
        )
        late.start()
        assert server.listeners(STREAM) == 1
        late.join()


def test_a_subscriber_that_never_comes_is_not_waited_for_for_ever(server: StreamingServer) -> None:
    server.expect(STREAM)
    assert server.listeners(STREAM) == 0


def test_without_waiting_a_slow_subscriber_misses_messages_but_never_parts_of_one(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()
    server.publish(STREAM, [bytes(LARGE)], wait=False)
    server.publish(STREAM, [b"left out"], wait=False)
    assert read_message(connection) == bytes(LARGE)
    while True:
        server.publish(STREAM, [b"next"], wait=False)
        connection.settimeout(0.05)
        try:
            message = read_message(connection)
        except TimeoutError:
            continue  # the loop has not yet noticed that all is written
        break
    assert message == b"next"


def test_waiting_publisher_goes_on_when_the_subscriber_has_read(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()
    messages = [bytes([number]) * LARGE for number in range(3)]

    def publish() -> None:
        for message in messages:
            server.publish(STREAM, [message], wait=True)

    publisher = threading.Thread(target=publish)
    publisher.start()
    assert [read_message(connection)[:1] for _ in messages] == [b"\0", b"\1", b"\2"]
    publisher.join(10.0)
    assert not publisher.is_alive()


@pytest.mark.parametrize("ending", ["the subscriber leaves", "the server ends"])
def test_waiting_publisher_is_let_go_when(
    server: StreamingServer, subscribers: Callable[[], socket.socket], ending: str
) -> None:
    connection = subscribers()
    server.publish(STREAM, [bytes(LARGE)], wait=True)
    publisher = threading.Thread(
        target=server.publish, args=(STREAM, [b"x"]), kwargs={"wait": True}
    )
    publisher.start()
    if ending == "the server ends":
        server.close()
    else:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.close()  # with unread data: a reset, as from a killed client
    publisher.join(10.0)
    assert not publisher.is_alive()


def test_subscriber_that_takes_nothing_is_dropped_when_the_patience_ends() -> None:
    with SocketLoop("test") as loop:
        server = StreamingServer(loop, bind("127.0.0.1", 0), patience_s=0.1)
        with ExitStack() as opened:
            stuck, healthy = (
                opened.enter_context(subscribe("127.0.0.1", server.port, STREAM + number))
                for number in range(2)
            )
            for number in range(2):
                server.expect(STREAM + number)
                assert server.listeners(STREAM + number) == 1
            server.publish(STREAM, [bytes(LARGE)], wait=True)
            server.publish(STREAM, [b"x"], wait=True)  # returns, because it gives the other up
            server.publish(STREAM + 1, [b"goes on"], wait=True)
            assert read_message(healthy) == b"goes on"
            await_listeners(server, 0)
            assert stuck.recv(1) == b"\0"
        server.close()


def test_subscriber_that_reads_slowly_but_reads_is_never_dropped() -> None:
    with SocketLoop("test") as loop:
        server = StreamingServer(loop, bind("127.0.0.1", 0), patience_s=0.5)
        with subscribe("127.0.0.1", server.port, STREAM) as slow:
            await_listeners(server, 1)
            server.publish(STREAM, [bytes(LARGE)], wait=True)
            publisher = threading.Thread(
                target=server.publish, args=(STREAM, [b"x"]), kwargs={"wait": True}
            )
            publisher.start()
            left, began = LARGE + 4, time.monotonic()
            while left:
                left -= len(slow.recv(min(left, 2 << 20), socket.MSG_WAITALL))
                time.sleep(0.05)  # which is how slow it reads
            assert time.monotonic() - began > 0.5  # longer than the patience
            assert read_message(slow) == b"x"
            publisher.join(10.0)
        server.close()


def test_in_one_frame_all_that_do_not_read_hold_up_the_world_once_and_miss_nothing(
    server: StreamingServer,
) -> None:
    with ExitStack() as opened:
        stuck = [
            opened.enter_context(subscribe("127.0.0.1", server.port, STREAM)) for _ in range(5)
        ]
        await_listeners(server, len(stuck))
        server.publish(STREAM, [bytes(LARGE)], wait=True)
        began_s = time.monotonic()
        server.begin_frame()
        server.publish(STREAM, [b"kept"], wait=True)
        server.publish(STREAM, [b"kept, too"], wait=True)
        assert time.monotonic() - began_s < len(stuck) * LONGEST_WAIT_S
        for connection in stuck:
            assert len(read_message(connection)) == LARGE
            assert read_message(connection) == b"kept"
            assert read_message(connection) == b"kept, too"


def test_who_took_nothing_in_a_whole_frame_holds_up_no_other_until_it_reads_on(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()

    def frame() -> float:
        began_s = time.monotonic()
        server.begin_frame()
        server.publish(STREAM, [b"kept"], wait=True)
        return time.monotonic() - began_s

    server.begin_frame()
    server.publish(STREAM, [bytes(LARGE)], wait=True)
    assert frame() >= LONGEST_WAIT_S
    assert frame() < LONGEST_WAIT_S / 2
    assert frame() < LONGEST_WAIT_S / 2
    assert len(read_message(connection)) == LARGE
    assert [read_message(connection) for _ in range(3)] == [b"kept"] * 3
    # It reads again: what comes next is waited for as at first.
    frame()
    server.publish(STREAM, [bytes(LARGE)], wait=True)
    assert frame() >= LONGEST_WAIT_S


def test_who_reads_too_slowly_to_catch_up_holds_up_one_frame_alone(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()
    server.begin_frame()
    server.publish(STREAM, [bytes(LARGE)], wait=True)
    took_s = []
    for _ in range(4):
        began_s = time.monotonic()
        server.begin_frame()
        server.publish(STREAM, [b"kept"], wait=True)
        took_s.append(time.monotonic() - began_s)
        read_bytes(connection, _RECEIVED_SLOWLY_BYTES)
    assert took_s[0] >= LONGEST_WAIT_S
    assert max(took_s[1:]) < LONGEST_WAIT_S / 2
    read_bytes(connection, LARGE + 4 - len(took_s) * _RECEIVED_SLOWLY_BYTES)
    assert [read_message(connection) for _ in took_s] == [b"kept"] * 4


def test_what_nobody_takes_is_kept_up_to_a_bound(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()
    sent = [bytes([number]) * LARGE for number in range(4)]
    for message in sent:
        server.publish(STREAM, [message], wait=True)
        server.begin_frame()
    # The first is partly in the kernel's buffers, the next two are kept, the last was left out.
    assert [read_message(connection)[:1] for _ in sent[:3]] == [b"\0", b"\1", b"\2"]
    await_that(lambda: not server.publish(STREAM, [b"next"], wait=True), within_s=1.0)
    assert read_message(connection) == b"next"


def test_who_announces_subscribers_in_vain_does_not_hold_up_every_frame(
    server: StreamingServer,
) -> None:
    took_s = []
    for _ in range(4):
        server.expect(STREAM, 60.0)
        server.begin_frame()
        began_s = time.monotonic()
        assert server.listeners(STREAM) == 0
        took_s.append(time.monotonic() - began_s)
    assert took_s[0] >= LONGEST_WAIT_S / 2
    assert sum(took_s[1:]) < LONGEST_WAIT_S


def test_only_the_client_that_announced_itself_is_awaited_until_it_comes_or_time_is_up(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    server.expect(STREAM, 60.0, "one")
    assert server.awaits("one")
    assert not server.awaits("other")
    server.begin_frame()
    subscribers()
    assert not server.awaits("one")
    server.expect(STREAM, 0.01, "late")
    await_that(lambda: not server.awaits("late"))


def test_subscriber_that_left_no_longer_counts(
    server: StreamingServer, subscribers: Callable[[], socket.socket]
) -> None:
    connection = subscribers()
    connection.close()
    await_listeners(server, 0)
    server.publish(STREAM, [b"to nobody"], wait=True)


class OutOfDescriptors(socket.socket):
    """A listening socket that cannot accept the first two times."""

    failures = 2

    def accept(self) -> tuple[socket.socket, object]:
        if self.failures:
            self.failures -= 1
            raise OSError(errno.EMFILE, "Too many open files")
        return super().accept()


def test_server_that_ran_out_of_descriptors_accepts_again_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(socket_loop, "_ACCEPT_AGAIN_S", 0.01)
    listening = OutOfDescriptors(fileno=bind("127.0.0.1", 0).detach())
    with SocketLoop("test") as loop:
        server = StreamingServer(loop, listening)
        with subscribe("127.0.0.1", server.port, STREAM):
            await_listeners(server, 1)
        server.close()


def test_port_that_something_listens_on_cannot_be_bound(server: StreamingServer) -> None:
    with pytest.raises(PortInUseError, match=str(server.port)):
        bind("127.0.0.1", server.port)


def test_port_that_something_began_to_listen_on_meanwhile_is_refused() -> None:
    reserved = bind("127.0.0.1", 0)
    port = reserved.getsockname()[1]
    with bind("127.0.0.1", port) as faster, SocketLoop("test") as loop:
        faster.listen()
        with pytest.raises(PortInUseError, match=str(port)):
            StreamingServer(loop, reserved)


def test_who_reads_is_looked_at_once_in_a_moment_and_again_for_a_new_subscriber(
    server: StreamingServer,
    subscribers: Callable[[], socket.socket],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: list[Channel] = []
    monkeypatch.setattr(Channel, "taken_bytes", property(lambda one: looked.append(one) or 0))
    now_s = time.monotonic()
    monkeypatch.setattr(streaming.time, "monotonic", lambda: now_s)
    subscribers()
    for _ in range(3):
        server.taking(STREAM)
    assert len(looked) == 1
    subscribers()
    server.taking(STREAM)
    assert len(looked) == 3
    now_s += 0.1
    server.taking(STREAM)
    assert len(looked) == 5


def test_it_is_known_whether_a_subscriber_reads_what_it_was_sent(
    server: StreamingServer,
    subscribers: Callable[[], socket.socket],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(streaming, "_LOOKED_AT_FOR_S", 0.0)
    assert server.taking(STREAM) is Taking.NOTHING
    idle = subscribers()
    assert server.taking(STREAM) is Taking.UNKNOWN
    # The server's kernel may take all of it; the other side has not.
    server.publish(STREAM, [bytes(2 << 20)], wait=False)
    assert server.taking(STREAM) is Taking.UNKNOWN
    now_s = time.monotonic()
    with monkeypatch.context() as later:
        later.setattr(streaming.time, "monotonic", lambda: now_s + 3.0)
        assert server.taking(STREAM) is Taking.NOTHING

    reader = subscribers()
    assert server.taking(STREAM) is Taking.UNKNOWN
    server.publish(STREAM, [b"little"], wait=False)
    assert read_message(reader) == b"little"
    await_that(lambda: server.taking(STREAM) is Taking.ALL)

    assert read_message(idle) == bytes(2 << 20)
    reader.close()
    await_listeners(server, 1)
    await_that(lambda: server.taking(STREAM) is Taking.ALL)


def test_who_took_everything_long_ago_is_not_given_up_for_a_message_just_sent(
    server: StreamingServer,
    subscribers: Callable[[], socket.socket],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    subscribers()
    server.publish(STREAM, [b"little"], wait=False)
    taken_bytes = 10
    monkeypatch.setattr(Channel, "taken_bytes", property(lambda _: taken_bytes))
    assert server.taking(STREAM) is Taking.ALL
    now_s = time.monotonic() + 10.0
    monkeypatch.setattr(streaming.time, "monotonic", lambda: now_s)
    server.publish(STREAM, [b"more"], wait=False)
    assert server.taking(STREAM) is Taking.UNKNOWN
    now_s += 10.0
    assert server.taking(STREAM) is Taking.NOTHING
