"""The probe tells a CARLA server from anything else that listens."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import repeat

import msgpack
import pytest

from carstage.errors import ServerError
from carstage.server import RemoteServer, free_port, probe_version
from carstage.server.probe import probe_world, wait_for_version

VERSION = msgpack.packb([1, 1, None, [[1, "0.9.16"]]])


@contextmanager
def answering(answer: bytes | None) -> Iterator[tuple[int, list[bytes]]]:
    """Listens, reads one request per connection, answers and closes; None keeps silent."""
    requests: list[bytes] = []
    done = threading.Event()

    def serve(listener: socket.socket) -> None:
        while True:
            connection, _ = listener.accept()
            with connection:
                data = connection.recv(4096)
                if not data:
                    return
                requests.append(data)
                if answer is None:
                    done.wait(20.0)
                else:
                    connection.sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        thread = threading.Thread(target=serve, args=(listener,))
        thread.start()
        yield port, requests
        done.set()
        socket.create_connection(("127.0.0.1", port)).close()
        thread.join(20.0)


def test_the_version_is_asked_for_as_carlas_client_asks() -> None:
    with answering(VERSION) as (port, requests):
        assert probe_version("127.0.0.1", port) == "0.9.16"
    assert msgpack.unpackb(requests[0]) == [0, 1, "version", [[False]]]


@pytest.mark.parametrize(
    "answer",
    [
        b"HTTP/1.1 400 Bad Request\r\n\r\n",
        msgpack.packb([1, 1, "no such function", None]),
        msgpack.packb([1, 1, None, [[0, ["error"]]]]),
        msgpack.packb("x" * 70000),
        b"\xc1",
        b"",
    ],
)
def test_anything_else_is_not_carla(answer: bytes) -> None:
    with answering(answer) as (port, _), pytest.raises(ServerError, match=f"127.0.0.1:{port}"):
        probe_version("127.0.0.1", port)


def test_a_listener_that_keeps_silent_is_given_up() -> None:
    with answering(None) as (port, _), pytest.raises(ServerError, match="timed out"):
        probe_version("127.0.0.1", port, timeout_s=0.1)


def test_server_without_a_world_is_not_taken_for_ready() -> None:
    loading = msgpack.packb([1, 1, None, [[0, "episode not ready"]]])
    with answering(loading) as (port, _), pytest.raises(ServerError, match="no world yet"):
        probe_world("127.0.0.1", port)
    with answering(None) as (port, _), pytest.raises(ServerError, match="timed out"):
        probe_world("127.0.0.1", port, timeout_s=0.1)
    with answering(msgpack.packb([1, 1, None, [1, [False]]])) as (port, requests):
        probe_world("127.0.0.1", port)
    assert msgpack.unpackb(requests[0]) == [0, 1, "get_episode_settings", [[False]]]


def test_waiting_ends_when_the_server_did() -> None:
    ended = iter([False, True])
    with pytest.raises(ServerError, match="ended before it answered"):
        wait_for_version("127.0.0.1", free_port(), 60.0, lambda _: next(ended))


def test_waiting_ends_at_the_deadline() -> None:
    never = repeat(False)
    with pytest.raises(ServerError, match=r"No CARLA server answers .* Waited 0 s"):
        wait_for_version("127.0.0.1", free_port(), 0.0, lambda _: next(never))


def test_a_remote_server_is_asked_and_left_alone() -> None:
    with answering(VERSION) as (port, _):
        with RemoteServer("127.0.0.1", port) as server:
            assert server.endpoint.version == "0.9.16"
            assert server.endpoint.pid is None
            assert server.alive()
        with pytest.raises(ServerError, match="is not started"):
            _ = server.endpoint
    assert not server.alive()


def test_a_remote_server_that_is_not_there_is_said_with_its_settings() -> None:
    port = free_port()
    with pytest.raises(ServerError, match=rf"127\.0\.0\.1:{port}.*server\.host") as caught:
        RemoteServer("127.0.0.1", port, timeout_s=0.1).start()
    assert caught.value.exit_code == 1


def test_a_remote_server_that_answered_before_is_waited_for_longer() -> None:
    server = RemoteServer("127.0.0.1", free_port(), timeout_s=0.0, return_s=0.3)
    with pytest.raises(ServerError, match="Waited 0 s"):
        server.start()
    with answering(VERSION) as (port, _):
        server = RemoteServer("127.0.0.1", port, timeout_s=20.0, return_s=0.3)
        server.start()
        server.stop()
    with pytest.raises(ServerError, match=r"Waited 0\.3 s"):
        server.start()
