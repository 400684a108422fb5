"""Whose call is served next."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import msgpack
import pytest

from carstage_sim.wire.rpc import Packed, Request, RpcServer
from carstage_sim.wire.socket_loop import SocketLoop, bind
from waiting import await_that


@pytest.fixture
def server() -> Iterator[RpcServer]:
    with SocketLoop("rpc sockets") as loop:
        yield RpcServer(loop, bind("127.0.0.1", 0))


def ask(sock: socket.socket, *names: str) -> None:
    sock.sendall(b"".join(msgpack.packb([0, 1, name, [[False]]]) for name in names))


def next_request(server: RpcServer) -> Request:
    event = server.next_event(5.0)
    assert isinstance(event, Request)
    return event


def asked(server: RpcServer, *calls: tuple[socket.socket, str]) -> None:
    """Sends calls of several clients so that they wait in that order."""
    for waiting, (sock, name) in enumerate(calls, start=1):
        ask(sock, name)
        await_that(lambda waiting=waiting: server.waiting == waiting)


def test_calls_are_served_as_they_came_and_after_a_long_one_the_others_go_first(
    server: RpcServer,
) -> None:
    with ExitStack() as opened:
        one, other = (
            opened.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            for _ in range(2)
        )
        calls = [(one, "a"), (one, "b"), (other, "c"), (one, "d"), (other, "e")]
        asked(server, *calls)
        assert [next_request(server).name for _ in calls] == ["a", "b", "c", "d", "e"]

        asked(server, *calls)
        first = next_request(server)
        first.connection.used_s += 1.0
        assert [next_request(server).name for _ in calls[1:]] == ["c", "e", "b", "d"]
        # The turn is over: what is asked later is served as it comes.
        asked(server, (one, "f"), (other, "g"))
        assert [next_request(server).name for _ in range(2)] == ["f", "g"]


def test_client_that_asks_one_call_at_a_time_is_not_put_behind_for_all_it_ever_asked(
    server: RpcServer,
) -> None:
    with ExitStack() as opened:
        one, other = (
            opened.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            for _ in range(2)
        )
        for _ in range(8):
            asked(server, (one, "a"), (other, "b"))
            first = next_request(server)
            first.connection.used_s += 0.01
            assert [first.name, next_request(server).name] == ["a", "b"]


def test_client_that_is_alone_is_served_whatever_its_calls_take(server: RpcServer) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as alone:
        ask(alone, "a", "b", "c")
        names = []
        for _ in range(3):
            request = next_request(server)
            request.connection.used_s += 1.0
            names.append(request.name)
    assert names == ["a", "b", "c"]


def test_packed_result_arrives_as_the_same_result_does_unpacked(server: RpcServer) -> None:
    value = {"list": [1.5, None, "text"], "bytes": b"\xff"}
    with socket.create_connection(("127.0.0.1", server.port)) as sock:
        ask(sock, "a")
        request = next_request(server)
        request.connection.reply(request, [[1, value]])
        request.connection.reply_packed(request, Packed.of(value))
        unpacker = msgpack.Unpacker()
        replies: list[object] = []
        while len(replies) < 2:
            unpacker.feed(sock.recv(1 << 16))
            replies.extend(unpacker)
    assert replies[0] == replies[1] == [1, 1, None, [[1, value]]]
