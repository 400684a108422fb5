"""Clients that send what no client should cost the server and the others nothing."""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import struct
from collections.abc import Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING

import msgpack
import pytest

from carstage_sim.wire import throttled_warnings
from carstage_sim.wire.channel import Channel
from carstage_sim.wire.rpc import Disconnected, Request, RpcServer
from carstage_sim.wire.socket_loop import SocketLoop, bind
from carstage_sim.wire.throttled_warnings import ThrottledWarnings
from raw_client import RawClient, subscribe
from waiting import await_that

if TYPE_CHECKING:
    from running_simulator import RunningSimulator


@pytest.fixture
def client(simulator: RunningSimulator) -> Iterator[RawClient]:
    with RawClient(simulator.host, simulator.port) as raw:
        raw.value("load_new_episode", "", True, 0xFFFF)
        yield raw


def connect(simulator: RunningSimulator) -> socket.socket:
    return socket.create_connection((simulator.host, simulator.port), timeout=20.0)


def request(name: str, *arguments: object) -> bytes:
    packed: bytes = msgpack.packb([0, 1, name, [[False], *arguments]])
    return packed


@pytest.mark.parametrize(
    "sent",
    [
        struct.pack(">BI", 0xDD, 0x7FFF_FFFF),
        b"\x94\x00\x01" + struct.pack(">BI", 0xDB, 0x7FFF_FFFF),
        b"\x94\x00\x01\xa7version\x92\x91\xc2" + struct.pack(">BI", 0xC6, 0x7FFF_FFFF),
        b"\x91" * 5000,
        b"\xc1",
        msgpack.packb({"not": "a request"}),
        msgpack.packb([2, "a notification", []]),
        msgpack.packb([0, 1, 2, 3]),
        b"\x81\x80\x00",
    ],
    ids=[
        "array",
        "string",
        "bytes",
        "nesting",
        "no msgpack",
        "map",
        "notification",
        "numbers",
        "a map as a key",
    ],
)
def test_what_is_no_request_ends_its_connection_and_nothing_else(
    simulator: RunningSimulator, client: RawClient, sent: bytes
) -> None:
    with connect(simulator) as rude:
        rude.sendall(sent)
        assert rude.recv(100) == b""
    assert client.value("version") == "0.9.16"


def test_half_a_message_waits_alone(simulator: RunningSimulator, client: RawClient) -> None:
    whole = request("version")
    with connect(simulator) as slow:
        slow.sendall(whole[:-3])
        assert client.value("version") == "0.9.16"
        slow.sendall(whole[-3:])
        assert b"0.9.16" in slow.recv(100)


@pytest.mark.parametrize("name", [b"\xa3\xff\xfe\xfd", b"\xa3\xed\xa0\x80"])
def test_name_that_is_no_text_is_an_unknown_call(
    simulator: RunningSimulator, client: RawClient, name: bytes
) -> None:
    with connect(simulator) as rude:
        rude.sendall(b"\x94\x00\x01" + name + b"\x91\x91\xc2")
        assert b"could not find function" in rude.recv(200)
    assert client.value("version") == "0.9.16"


def test_flood_without_reading_is_held_back_and_others_are_served(
    simulator: RunningSimulator, client: RawClient
) -> None:
    flood = request("get_actor_definitions") * 1000
    with connect(simulator) as rude:
        sent = 0
        while select.select([], [rude], [], 0.5)[1]:  # sooner or later nothing more is taken
            sent += rude.send(flood[:4096])
            assert sent < 64 << 20
        for _ in range(5):
            assert client.value("version") == "0.9.16"


def test_calls_sent_just_before_leaving_are_all_served(
    simulator: RunningSimulator, client: RawClient
) -> None:
    calls = [
        msgpack.packb([0, number, "set_weather_parameters", [[True], [float(number)] + [0.0] * 13]])
        for number in range(1, 101)
    ]
    with connect(simulator) as leaving:
        leaving.sendall(b"".join(calls * 3))
        leaving.shutdown(socket.SHUT_WR)
        while leaving.recv(1 << 16):  # else the replies that nobody reads would reset everything
            pass
    await_that(lambda: client.value("get_weather_parameters")[0] == 100.0)


def test_subscriber_that_talks_is_closed(simulator: RunningSimulator, client: RawClient) -> None:
    with subscribe(simulator.host, simulator.streaming_port, 77) as stream:
        stream.sendall(b"GET / HTTP/1.1\r\n\r\n")
        # A reset is the same: the server had not read all of it.
        with contextlib.suppress(ConnectionResetError):
            assert stream.recv(100) == b""
    assert client.value("version") == "0.9.16"


def test_requests_that_wait_are_bounded_per_connection() -> None:
    with SocketLoop("test") as loop:
        server = RpcServer(loop, bind("127.0.0.1", 0))
        address = ("127.0.0.1", server.port)
        with socket.create_connection(address) as greedy, socket.create_connection(address) as fair:
            greedy.sendall(request("greedy") * 2000)
            first = server.next_event(10.0)
            fair.sendall(request("fair"))
            assert isinstance(first, Request)
            await_that(lambda: first.connection.waiting > 100)
            names = []
            while "fair" not in names:
                event = server.next_event(10.0)
                assert isinstance(event, Request)
                names.append(event.name)
            assert len(names) < 1000
            while len(names) < 2000:
                event = server.next_event(10.0)
                assert isinstance(event, Request)
                names.append(event.name)
            assert names.count("greedy") == 1999


def test_end_of_a_client_comes_after_all_that_it_sent() -> None:
    with SocketLoop("test") as loop:
        server = RpcServer(loop, bind("127.0.0.1", 0))
        with socket.create_connection(("127.0.0.1", server.port)) as leaving:
            leaving.sendall(request("last words") * 1000)
        events = [server.next_event(10.0) for _ in range(1001)]
        assert all(isinstance(event, Request) for event in events[:-1])
        assert isinstance(events[-1], Disconnected)


def test_silent_connections_make_room_for_new_ones_the_oldest_first() -> None:
    channels: list[Channel] = []
    with SocketLoop("test") as loop:
        listening = bind("127.0.0.1", 0)
        address = listening.getsockname()
        loop.listen(listening, channels.append, most=3)
        sockets = []
        for number in range(3):
            sockets.append(socket.create_connection(address))
            await_that(lambda: len(channels) == number + 1)  # noqa: B023 - called at once
        sockets[0].sendall(b"I speak")
        await_that(lambda: not channels[0].silent)
        sockets.append(socket.create_connection(address))
        await_that(lambda: len(channels) == 4)
        assert [channel.closed for channel in channels] == [False, True, False, False]
        for number in (2, 3):
            sockets[number].sendall(b"so do I")
            await_that(lambda: not channels[number].silent)  # noqa: B023 - called at once
        with socket.create_connection(address) as too_many:
            assert too_many.recv(1) == b""
        for connection in sockets:
            connection.close()
        await_that(lambda: all(channel.closed for channel in channels))
        with socket.create_connection(address):
            await_that(lambda: len(channels) == 5)


def test_same_trouble_is_logged_once_with_a_count(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [100.0]
    monkeypatch.setattr(throttled_warnings, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    told = ThrottledWarnings(logging.getLogger("test"), again_after_s=10.0)
    for _ in range(5):
        told.warn("it rains", "again")
    assert [record.getMessage() for record in caplog.records] == ["it rains: again"]
    now_s[0] += 10.0
    told.warn("it rains", "still")
    assert "4 more" in caplog.records[-1].getMessage()


def test_call_that_nobody_waits_for_is_answered_too(client: RawClient) -> None:
    # rpclib keeps a promise per call until an answer comes.
    clouds = [[True], [20.0] + [0.0] * 13]
    client.socket.sendall(msgpack.packb([0, 4711, "set_weather_parameters", clouds]))
    assert msgpack.unpackb(client.socket.recv(100))[:2] == [1, 4711]


@pytest.mark.parametrize("port", ["port", "streaming_port"])
def test_reset_connection_costs_nobody_else_anything(
    simulator: RunningSimulator, client: RawClient, port: str
) -> None:
    address = (simulator.host, getattr(simulator, port))
    with socket.create_connection(address, timeout=20.0) as leaving:
        leaving.sendall(struct.pack("<I", 1))
        leaving.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    for _ in range(3):
        client.value("tick_cue")


@pytest.mark.parametrize(
    ("type_id", "name", "good", "bad"),
    [
        ("vehicle.tesla.model3", "color", "0, 17,255", ("red", "1,2", "1,2,3,4", "1,2,256")),
        ("vehicle.tesla.model3", "color", "12.0,3.5,0.0", ("-1,2,3", "1,2,256.0", "1,2,3x")),
        ("vehicle.tesla.model3", "sticky_control", "FALSE", ("yes", "")),
        ("static.trigger.friction", "friction", "3.5f", ("fast", "inf", "nan", "1e39", "")),
        ("sensor.other.gnss", "noise_seed", "7", ("x", "1e999")),
    ],
)
def test_attribute_that_clients_could_not_decode_is_refused_when_it_is_spawned(
    client: RawClient, type_id: str, name: str, good: str, bad: tuple[str, ...]
) -> None:
    def spawn(value: str) -> list[object]:
        answer: list[object] = client.call("spawn_actor", [0, type_id, [[name, 3, value]]], place)
        return answer

    place = client.value("get_map_info")[1][0]
    for value in bad:
        error, ((kind, (message,)),) = spawn(value)
        assert (error, kind) == (None, 0)
        assert message.startswith(f"{type_id}: attribute {name} is {value!r}, not ")
    error, ((kind, _),) = spawn(good)
    assert (error, kind) == (None, 1)


def test_settings_come_back_to_clients_in_the_types_that_they_decode(client: RawClient) -> None:
    before = client.value("get_episode_settings")
    for index, value in ((0, "yes"), (1, 0.5), (3, None), (5, "x"), (5, 10**6), (7, 1), (8, "y")):
        wrong = [*before[:index], value, *before[index + 1 :]]
        error, ((kind, *_),) = client.call("set_episode_settings", wrong)
        assert (error, kind) == (None, 0)
    assert client.value("get_episode_settings") == before
