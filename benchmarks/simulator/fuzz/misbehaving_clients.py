"""Connections that behave as no client should, one function each.

Each takes a :class:`MisbehavingClient` and does its worst for a moment. The caller closes what it
opened later, so that the connections of several overlap.
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

from benchmarks.simulator.fuzz.hostile_maps import REFUSED_MAPS, large_map
from benchmarks.simulator.fuzz.requests import Requests, refused_requests, wrong_arguments

_CONNECT_TIMEOUT_S = 20.0
_REPLY_TIMEOUT_S = 30.0
_FLOOD_BYTES = 256 << 10
_SMALL_BUFFER = 4096
_MOST_SPAWNED = 40
_REMEMBERED = 3
_REMEMBERED_CHARACTERS = 500
_LARGEST_ID = 1_000_000

Misbehaviour = Callable[["MisbehavingClient"], None]
ALL: dict[str, Misbehaviour] = {}


class UnansweredError(RuntimeError):
    """The server left a whole request without an answer."""


@dataclass
class MisbehavingClient:
    """What a misbehaving connection works with.

    Attributes:
        port, streaming_port: the server's.
        rng: source of all choices.
        requests: makes calls.
        spawned: ids of actors that misbehaving clients brought into the world.
        sockets: what stays open for a while.
        calls: how many requests were sent one by one.
        last: the last of them, for who has to find out what they did.
    """

    port: int
    streaming_port: int
    rng: random.Random
    requests: Requests
    spawned: list[int]
    sockets: ExitStack = field(default_factory=ExitStack)
    calls: int = 0
    last: deque[str] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def connect(self, port: int | None = None) -> socket.socket:
        """A connection to the RPC port, or to another."""
        address = ("127.0.0.1", self.port if port is None else port)
        return self.sockets.enter_context(
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


def misbehaviour(function: Misbehaviour) -> Misbehaviour:
    """Registers a way to misbehave."""
    ALL[function.__name__] = function
    return function


@misbehaviour
def wrong_calls(client: MisbehavingClient) -> None:
    """Calls in which something is wrong; each must be answered."""
    connection = client.connect()
    for _ in range(40):
        make = client.requests.mutated if client.rng.random() < 0.8 else client.requests.valid
        name, arguments = make()
        _, result = client.ask(connection, name, arguments)
        client.spawned.extend(_spawned(name, result))
    for actor_id in client.spawned[:-_MOST_SPAWNED]:
        client.ask(connection, "destroy_actor", [actor_id])
    del client.spawned[:-_MOST_SPAWNED]


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


@misbehaviour
def world_wide_nonsense(client: MisbehavingClient) -> None:
    """Settings and maps that cannot be."""
    connection = client.connect()
    for name, arguments in client.rng.sample(refused_requests(), 8):
        client.ask(connection, name, arguments)


@misbehaviour
def wrong_counts_and_types(client: MisbehavingClient) -> None:
    """Every call that the server knows, with arguments of other types, too few and too many."""
    connection = client.connect()
    for name, arguments in wrong_arguments(client.rng):
        client.ask(connection, name, arguments)


@misbehaviour
def unknown_calls(client: MisbehavingClient) -> None:
    """Calls that do not exist, with names of all kinds."""
    connection = client.connect()
    for name in ("make_coffee", "", "\udcff\udcfe", "x" * 10_000, "__class__"):
        packed = msgpack.packb([0, 1, name, [[False], 1]], unicode_errors="surrogateescape")
        connection.sendall(packed)
    connection.recv(1 << 16)


@misbehaviour
def garbage(client: MisbehavingClient) -> None:
    """Random bytes to both ports."""
    for port in (client.port, client.streaming_port):
        connection = client.connect(port)
        _send(connection, client.rng.randbytes(client.rng.randrange(1, 5000)))


@misbehaviour
def no_requests(client: MisbehavingClient) -> None:
    """Whole messages that are no requests."""
    messages: tuple[Any, ...] = (
        *({}, 7, [0, 1, 2, 3], [2, "note", []], [1, 1, None, 5], [0, -1, "version", 1]),
    )
    for message in messages:
        _send(client.connect(), msgpack.packb(message))


@misbehaviour
def half_messages(client: MisbehavingClient) -> None:
    """Requests that end in the middle, and stay so."""
    for _ in range(5):
        packed = client.requests.packed(*client.requests.valid())
        _send(client.connect(), packed[: client.rng.randrange(1, len(packed))])
    _send(client.connect(client.streaming_port), b"\x01\x00")


@misbehaviour
def huge_lengths(client: MisbehavingClient) -> None:
    """Headers that promise gigabytes, deep nesting, many arrays in arrays."""
    for tag in (0xC6, 0xC9, 0xDB, 0xDD, 0xDF):
        for before in (b"", b"\x94\x00\x01", b"\x94\x00\x01\xa7version\x92\x91\xc2"):
            _send(client.connect(), before + struct.pack(">BI", tag, 0x7FFF_FFFF))
    _send(client.connect(), b"\x91" * 100_000)
    _send(client.connect(), struct.pack(">BI", 0xDD, 1 << 20) * 1000)
    _send(client.connect(client.streaming_port), struct.pack("<I", 0x7FFF_FFFF))


@misbehaviour
def flood_without_reading(client: MisbehavingClient) -> None:
    """Many calls whose replies nobody reads."""
    connection = client.connect()
    name = client.rng.choice(("get_actor_definitions", "get_map_data", "version", "get_map_info"))
    packed = client.requests.packed(name, [])
    sent = 0
    while sent < _FLOOD_BYTES and select.select([], [connection], [], 0.05)[1]:
        sent += connection.send(packed * (8192 // len(packed)))


@misbehaviour
def flood_of_refusals(client: MisbehavingClient) -> None:
    """Many wrong calls at once, read to the end."""
    connection = client.connect()
    count = 300
    connection.sendall(b"".join(client.requests.packed("destroy_actor", []) for _ in range(count)))
    unpacker, answered = msgpack.Unpacker(), 0
    connection.settimeout(_REPLY_TIMEOUT_S)
    while answered < count:
        data = connection.recv(1 << 16)
        if not data:
            raise UnansweredError(f"{answered} of {count} refusals came")
        unpacker.feed(data)
        answered += sum(1 for _ in unpacker)


@misbehaviour
def silent_crowd(client: MisbehavingClient) -> None:
    """Connections that never send anything."""
    for _ in range(50):
        client.connect()
        client.connect(client.streaming_port)


@misbehaviour
def streams_that_do_not_exist(client: MisbehavingClient) -> None:
    """Subscriptions to numbers that nobody gave out."""
    for stream_id in (0, 2**32 - 1, client.rng.randrange(2**32)):
        client.connect(client.streaming_port).sendall(struct.pack("<I", stream_id))


@misbehaviour
def slow_reader(client: MisbehavingClient) -> None:
    """A subscriber of the world's snapshots that never reads."""
    _, ((_, (_, (token,))),) = client.ask(client.connect(), "get_episode_info", [])
    reader = client.sockets.enter_context(socket.socket())
    reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SMALL_BUFFER)
    reader.settimeout(_CONNECT_TIMEOUT_S)
    reader.connect(("127.0.0.1", client.streaming_port))
    reader.sendall(token[:4])


@misbehaviour
def talkative_subscriber(client: MisbehavingClient) -> None:
    """A subscriber that goes on sending."""
    connection = client.connect(client.streaming_port)
    _send(connection, struct.pack("<I", 1) + b"x" * 100_000)


@misbehaviour
def leaves_in_the_middle(client: MisbehavingClient) -> None:
    """Resets the connection while calls are under way, one of them a claim on the world."""
    connection = client.connect()
    settings = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
    connection.sendall(client.requests.packed("set_episode_settings", [settings]))
    connection.sendall(client.requests.packed("get_actor_definitions", []) * 20)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


@misbehaviour
def drips(client: MisbehavingClient) -> None:
    """Requests that come a byte at a time, over many connections, and never end."""
    connections = [client.connect() for _ in range(20)]
    packed = client.requests.packed("version", ["x" * 60])
    for byte in packed[:40]:
        for connection in connections:
            _send(connection, bytes([byte]))


@misbehaviour
def half_open(client: MisbehavingClient) -> None:
    """Connections whose sending half is closed, before and after a request; subscribers alike."""
    for request in (b"", client.requests.packed("get_map_data", [])):
        connection = client.connect()
        _send(connection, request)
        connection.shutdown(socket.SHUT_WR)
    subscriber = client.connect(client.streaming_port)
    _send(subscriber, struct.pack("<I", _episode_stream(client)))
    subscriber.shutdown(socket.SHUT_WR)


@misbehaviour
def flood_of_connections(client: MisbehavingClient) -> None:
    """Connections that are reset as soon as they are there."""
    linger = struct.pack("ii", 1, 0)
    for number in range(300):
        port = client.streaming_port if number % 2 else client.port
        with socket.create_connection(("127.0.0.1", port), timeout=_CONNECT_TIMEOUT_S) as brief:
            brief.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)


@misbehaviour
def crowd_of_slow_readers(client: MisbehavingClient) -> None:
    """Hundreds of subscriptions to all that there is, by who never reads."""
    streams = [_episode_stream(client), *_sensor_streams(client)]
    for number in range(300):
        reader = client.sockets.enter_context(socket.socket())
        reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SMALL_BUFFER)
        reader.settimeout(_CONNECT_TIMEOUT_S)
        reader.connect(("127.0.0.1", client.streaming_port))
        _send(reader, struct.pack("<I", streams[number % len(streams)]))


@misbehaviour
def announced_subscribers(client: MisbehavingClient) -> None:
    """Asks for the addresses of all streams, again and again, and never subscribes."""
    connection = client.connect()
    streams = [_episode_stream(client), *_sensor_streams(client)]
    for _ in range(20):
        for stream_id in streams:
            client.ask(connection, "get_sensor_token", [stream_id])


@misbehaviour
def hostile_maps(client: MisbehavingClient) -> None:
    """OpenDRIVE texts that are too much, or nothing; who sent the large one does not wait."""
    connection = client.connect()
    options = [2.0, 50.0, 0.0, 0.6, True, True, False]
    for text in client.rng.sample(REFUSED_MAPS, 3):
        client.ask(connection, "copy_opendrive_to_file", [text, options])
    large = client.requests.packed("copy_opendrive_to_file", [large_map(client.rng), options])
    leaving = client.connect()
    _send(leaving, large)
    leaving.shutdown(socket.SHUT_WR)


@misbehaviour
def large_messages(client: MisbehavingClient) -> None:
    """Whole requests of megabytes: texts, lists, batches of nonsense."""
    connection = client.connect()
    for name, arguments in (
        ("version", ["x" * (4 << 20)]),
        ("get_actors_by_id", [list(range(200_000))]),
        ("apply_batch", [[[99, [1]]] * 2000, False]),
        ("draw_debug_shape", [[0] * 100_000]),
    ):
        client.ask(connection, name, arguments)


def _episode_stream(client: MisbehavingClient) -> int:
    _, ((_, (_, (token,))),) = client.ask(client.connect(), "get_episode_info", [])
    stream_id: int = struct.unpack_from("<I", token)[0]
    return stream_id


def _sensor_streams(client: MisbehavingClient) -> list[int]:
    """Streams of all sensors, whoever's they are."""
    _, ((_, actors),) = client.ask(client.connect(), "get_actors_by_id", [list(range(1000))])
    tokens = [actor[5] for actor in actors if len(actor) > 5 and len(actor[5]) >= 4]
    return [struct.unpack_from("<I", bytes(token))[0] for token in tokens]


def _send(connection: socket.socket, data: bytes) -> None:
    """Sends what a server may well have hung up on by now."""
    try:
        connection.sendall(data)
    except (ConnectionResetError, BrokenPipeError):
        return
