"""The proxy passes on what it should and disturbs what it should, nothing else."""

from __future__ import annotations

import asyncio
import random
import socket
import socketserver
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from benchmarks.framework.faults.streams import (
    Cut,
    Disturbance,
    DisturbedStreams,
    Doubled,
    Late,
    Silent,
    Swapped,
)
from carstage.server import allot_ports

PROXY_HOST = "127.0.0.3"
WORLD_STREAM = 1
CAMERA_STREAM = 7
MESSAGES = [f"message {number}".encode() for number in range(6)]


async def _passed(disturbance: Disturbance, messages: list[bytes]) -> list[bytes]:
    sent: list[bytes] = []

    async def send(message: bytes) -> None:
        sent.append(message)

    for message in messages:
        await disturbance.pass_on(message, send)
    return sent


def passed(disturbance: Disturbance) -> list[bytes]:
    """What is sent on of the messages, in this order."""
    return asyncio.run(_passed(disturbance, MESSAGES))


def test_silent_stream_sends_nothing_from_its_message_on() -> None:
    assert passed(Silent(3)) == MESSAGES[:2]


def test_cut_stream_breaks_off_at_its_message() -> None:
    with pytest.raises(ConnectionResetError):
        passed(Cut(3))


def test_late_message_keeps_its_place() -> None:
    assert passed(Late(2, 0.01)) == MESSAGES


def test_doubled_messages_follow_themselves() -> None:
    assert passed(Doubled(random.Random(0), 1.0)) == [m for m in MESSAGES for _ in range(2)]


def test_swapped_messages_overtake_each_other_and_none_is_lost() -> None:
    first, second, *rest = passed(Swapped(random.Random(0), 1.0))
    assert (first, second) == (MESSAGES[1], MESSAGES[0])
    assert sorted([first, second, *rest]) == MESSAGES


class Streams(socketserver.BaseRequestHandler):
    """A server's streams: each connection names its stream and gets all messages."""

    def handle(self) -> None:
        self.request.recv(4)
        for message in MESSAGES:
            self.request.sendall(struct.pack("<I", len(message)) + message)
        self.request.recv(1)  # the client closes


class Calls(socketserver.BaseRequestHandler):
    """A server's RPC port: sends back what it receives."""

    def handle(self) -> None:
        while data := self.request.recv(1024):
            self.request.sendall(data)


@contextmanager
def listening(port: int, handler: type[socketserver.BaseRequestHandler]) -> Iterator[None]:
    with socketserver.ThreadingTCPServer(("127.0.0.1", port), handler) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def proxy() -> Iterator[tuple[int, int]]:
    ports = allot_ports()

    def second_is_silent(stream: int) -> Disturbance | None:
        return Silent(3) if stream == 1 else None

    with (
        listening(ports.rpc, Calls),
        listening(ports.streaming, Streams),
        DisturbedStreams(PROXY_HOST, ports.rpc, ports.streaming, second_is_silent),
    ):
        yield ports.rpc, ports.streaming


def read(connection: socket.socket, count: int) -> list[bytes]:
    """So many messages of a stream; fewer when it falls silent."""
    file = connection.makefile("rb")
    found = []
    try:
        for _ in range(count):
            (length,) = struct.unpack("<I", file.read(4))
            found.append(file.read(length))
    except TimeoutError:
        pass
    return found


def subscribe(port: int, stream: int) -> socket.socket:
    connection = socket.create_connection((PROXY_HOST, port), timeout=0.5)
    connection.sendall(struct.pack("<I", stream))
    return connection


def test_proxy_passes_calls_and_the_worlds_stream_on_and_counts_sensors_alone(
    proxy: tuple[int, int],
) -> None:
    rpc, streaming = proxy
    with socket.create_connection((PROXY_HOST, rpc), timeout=10) as calls:
        calls.sendall(b"version?")
        assert calls.recv(100) == b"version?"
    with subscribe(streaming, CAMERA_STREAM) as first:
        assert read(first, len(MESSAGES)) == MESSAGES
    with subscribe(streaming, WORLD_STREAM) as world:
        assert read(world, len(MESSAGES)) == MESSAGES
    with subscribe(streaming, CAMERA_STREAM + 1) as second:
        assert read(second, len(MESSAGES)) == MESSAGES[:2]
