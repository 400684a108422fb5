"""Connections that behave as no client should, one function each.

Each takes a :class:`Rude` and does its worst for a moment; what it opened is closed by the caller
at a time of its own choosing, so that rudeness overlaps.
"""

from __future__ import annotations

import random
import select
import socket
import struct
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import msgpack

from benchmarks.simulator.fuzz.requests import Requests, refused_requests

_CONNECT_TIMEOUT_S = 20.0
_REPLY_TIMEOUT_S = 30.0
_FLOOD_BYTES = 256 << 10
_SMALL_BUFFER = 4096
_MOST_SPAWNED = 40
_REMEMBERED = 3
_REMEMBERED_CHARACTERS = 500
_LARGEST_ID = 1_000_000

Rudeness = Callable[["Rude"], None]
ALL: dict[str, Rudeness] = {}


class UnansweredError(RuntimeError):
    """The server left a whole request without an answer."""


@dataclass
class Rude:
    """What a rude connection works with.

    Attributes:
        port, streaming_port: the server's.
        rng: source of all choices.
        requests: makes calls.
        spawned: ids of actors that rude clients brought into the world.
        opened: what stays open for a while.
        calls: how many requests were sent one by one.
        last: the last of them, for who has to find out what they did.
    """

    port: int
    streaming_port: int
    rng: random.Random
    requests: Requests
    spawned: list[int]
    opened: ExitStack = field(default_factory=ExitStack)
    calls: int = 0
    last: deque[str] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def connect(self, port: int | None = None) -> socket.socket:
        """A connection to the RPC port, or to another."""
        address = ("127.0.0.1", self.port if port is None else port)
        return self.opened.enter_context(
            socket.create_connection(address, timeout=_CONNECT_TIMEOUT_S)
        )

    def ask(self, connection: socket.socket, name: str, arguments: list[Any]) -> Any:
        """Send one request and wait for its reply.

        Raises:
            UnansweredError: none came in time, or the connection was closed.
        """
        self.calls += 1
        self.last.append(f"{name}{str(arguments)[:_REMEMBERED_CHARACTERS]}")
        connection.settimeout(_REPLY_TIMEOUT_S)
        connection.sendall(self.requests.packed(name, arguments, self.calls))
        unpacker = msgpack.Unpacker(strict_map_key=False, unicode_errors="surrogateescape")
        while True:
            for _, _, error, result in unpacker:
                return error, result
            try:
                data = connection.recv(1 << 18)
            except OSError as failure:
                raise UnansweredError(f"{name}{str(arguments)[:300]}: {failure}") from failure
            if not data:
                raise UnansweredError(f"{name}{str(arguments)[:300]}: connection closed")
            unpacker.feed(data)


def rudeness(function: Rudeness) -> Rudeness:
    """Registers a way to be rude."""
    ALL[function.__name__] = function
    return function


@rudeness
def wrong_calls(rude: Rude) -> None:
    """Calls in which something is wrong; each must be answered."""
    connection = rude.connect()
    for _ in range(40):
        make = rude.requests.mutated if rude.rng.random() < 0.8 else rude.requests.valid
        name, arguments = make()
        _, result = rude.ask(connection, name, arguments)
        rude.spawned.extend(_spawned(name, result))
    for actor_id in rude.spawned[:-_MOST_SPAWNED]:
        rude.ask(connection, "destroy_actor", [actor_id])
    del rude.spawned[:-_MOST_SPAWNED]


def _spawned(name: str, result: Any) -> list[int]:
    """Ids of what a call brought into the world."""
    try:
        if name in ("spawn_actor", "spawn_actor_with_parent"):
            ((ok, actor),) = result
            return [actor[0]] if ok == 1 else []
        if name == "apply_batch":
            ids = [value for ((ok, value),) in result if ok == 1 and isinstance(value, int)]
            return [actor_id for actor_id in ids if 2 < actor_id < _LARGEST_ID]
    except (TypeError, ValueError):  # a refusal of the whole call
        pass
    return []


@rudeness
def world_wide_nonsense(rude: Rude) -> None:
    """Settings and maps that cannot be."""
    connection = rude.connect()
    for name, arguments in rude.rng.sample(refused_requests(), 8):
        rude.ask(connection, name, arguments)


@rudeness
def unknown_calls(rude: Rude) -> None:
    """Calls that do not exist, with names of all kinds."""
    connection = rude.connect()
    for name in ("make_coffee", "", "\udcff\udcfe", "x" * 10_000, "__class__"):
        packed = msgpack.packb([0, 1, name, [[False], 1]], unicode_errors="surrogateescape")
        connection.sendall(packed)
    connection.recv(1 << 16)


@rudeness
def garbage(rude: Rude) -> None:
    """Random bytes to both ports."""
    for port in (rude.port, rude.streaming_port):
        connection = rude.connect(port)
        _send(connection, rude.rng.randbytes(rude.rng.randrange(1, 5000)))


@rudeness
def no_requests(rude: Rude) -> None:
    """Whole messages that are no requests."""
    messages: tuple[Any, ...] = (
        *({}, 7, [0, 1, 2, 3], [2, "note", []], [1, 1, None, 5], [0, -1, "version", 1]),
    )
    for message in messages:
        _send(rude.connect(), msgpack.packb(message))


@rudeness
def half_messages(rude: Rude) -> None:
    """Requests that end in the middle, and stay so."""
    for _ in range(5):
        packed = rude.requests.packed(*rude.requests.valid())
        _send(rude.connect(), packed[: rude.rng.randrange(1, len(packed))])
    _send(rude.connect(rude.streaming_port), b"\x01\x00")


@rudeness
def huge_lengths(rude: Rude) -> None:
    """Headers that promise gigabytes, deep nesting, many arrays in arrays."""
    for tag in (0xC6, 0xC9, 0xDB, 0xDD, 0xDF):
        for before in (b"", b"\x94\x00\x01", b"\x94\x00\x01\xa7version\x92\x91\xc2"):
            _send(rude.connect(), before + struct.pack(">BI", tag, 0x7FFF_FFFF))
    _send(rude.connect(), b"\x91" * 100_000)
    _send(rude.connect(), struct.pack(">BI", 0xDD, 1 << 20) * 1000)
    _send(rude.connect(rude.streaming_port), struct.pack("<I", 0x7FFF_FFFF))


@rudeness
def flood_without_reading(rude: Rude) -> None:
    """Many calls whose replies nobody reads."""
    connection = rude.connect()
    name = rude.rng.choice(("get_actor_definitions", "get_map_data", "version", "get_map_info"))
    packed = rude.requests.packed(name, [])
    sent = 0
    while sent < _FLOOD_BYTES and select.select([], [connection], [], 0.05)[1]:
        sent += connection.send(packed * (8192 // len(packed)))


@rudeness
def flood_of_refusals(rude: Rude) -> None:
    """Many wrong calls at once, read to the end."""
    connection = rude.connect()
    count = 300
    connection.sendall(b"".join(rude.requests.packed("destroy_actor", []) for _ in range(count)))
    unpacker, answered = msgpack.Unpacker(), 0
    connection.settimeout(_REPLY_TIMEOUT_S)
    while answered < count:
        data = connection.recv(1 << 16)
        if not data:
            raise UnansweredError(f"{answered} of {count} refusals came")
        unpacker.feed(data)
        answered += sum(1 for _ in unpacker)


@rudeness
def silent_crowd(rude: Rude) -> None:
    """Connections that never say anything."""
    for _ in range(50):
        rude.connect()
        rude.connect(rude.streaming_port)


@rudeness
def streams_that_do_not_exist(rude: Rude) -> None:
    """Subscriptions to numbers that nobody gave out."""
    for stream_id in (0, 2**32 - 1, rude.rng.randrange(2**32)):
        rude.connect(rude.streaming_port).sendall(struct.pack("<I", stream_id))


@rudeness
def slow_reader(rude: Rude) -> None:
    """A subscriber of the world's snapshots that never reads."""
    _, ((_, (_, (token,))),) = rude.ask(rude.connect(), "get_episode_info", [])
    reader = rude.opened.enter_context(socket.socket())
    reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SMALL_BUFFER)
    reader.settimeout(_CONNECT_TIMEOUT_S)
    reader.connect(("127.0.0.1", rude.streaming_port))
    reader.sendall(token[:4])


@rudeness
def talkative_subscriber(rude: Rude) -> None:
    """A subscriber that goes on sending."""
    connection = rude.connect(rude.streaming_port)
    _send(connection, struct.pack("<I", 1) + b"x" * 100_000)


@rudeness
def leaves_in_the_middle(rude: Rude) -> None:
    """Resets the connection while calls are under way, one of them a claim on the world."""
    connection = rude.connect()
    settings = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
    connection.sendall(rude.requests.packed("set_episode_settings", [settings]))
    connection.sendall(rude.requests.packed("get_actor_definitions", []) * 20)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def _send(connection: socket.socket, data: bytes) -> None:
    """Sends what a server may well have hung up on by now."""
    try:
        connection.sendall(data)
    except (ConnectionResetError, BrokenPipeError):
        return
