"""What a server does beside answering calls: it goes wrong without an end of the server."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

import pytest

from carstage_sim.server import Server
from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.handlers import TickRequest
from carstage_sim.wire.rpc import Connection, Disconnected
from carstage_sim.wire.socket_loop import bind
from carstage_sim.world.controls import EpisodeSettings

SYNCHRONOUS = EpisodeSettings(synchronous_mode=True)


@contextmanager
def serving(
    advance: Callable[[Server], None], pace_hz: float | None = None
) -> Iterator[tuple[Server, Any]]:
    """A server of a simulation that has settings and bakes, and no world."""
    simulation = SimpleNamespace(
        settings=SYNCHRONOUS,
        bakes=SimpleNamespace(),
        finish_drawing=lambda: None,
        hold_late_drawing=lambda *, held: None,
        may_have_changed=lambda: None,
    )
    with (
        bind("127.0.0.1", 0) as rpc_socket,
        bind("127.0.0.1", 0) as streaming_socket,
        Server(
            cast(Any, simulation),
            dialect("0.9.16"),
            rpc_socket=rpc_socket,
            streaming_socket=streaming_socket,
            frames_per_s=20.0,
            pace_hz=pace_hz,
        ) as server,
    ):
        simulation.bakes.advance = lambda: advance(server)
        yield server, simulation


@pytest.fixture(autouse=True)
def without_a_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Server, "_episode_began", lambda *_arguments: None)


def test_bakes_go_on_while_no_call_comes_and_their_failure_ends_no_server(
    caplog: pytest.LogCaptureFixture,
) -> None:
    advanced = []

    def advance(server: Server) -> None:
        advanced.append(server)
        if len(advanced) == 1:
            raise OSError("no space left")
        server.stop()

    with serving(advance) as (server, _):
        server.run()
    assert len(advanced) == 2
    assert "no space left" in caplog.text


def test_a_delayed_action_that_fails_ends_no_server(caplog: pytest.LogCaptureFixture) -> None:
    def fail() -> None:
        raise LookupError("delayed")

    with serving(lambda _: None) as (server, _):
        server._after(0.0, fail)
        server._after(0.0, server.stop)
        server.run()
    assert "delayed" in caplog.text


def test_a_delayed_load_that_resets_the_settings_frees_the_world_of_its_holders() -> None:
    idle = cast(Connection, object())
    with serving(lambda _: None) as (server, simulation):
        server._owners.served(idle, EpisodeSettings(), SYNCHRONOUS, takes_over=True)

        def load() -> None:
            simulation.settings = EpisodeSettings()

        server._after(0.0, load)
        server._run_due()
        assert not server._owners.owned


def test_memory_is_given_back_once_after_all_clients_that_left_in_a_moment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock_s, given_back = [100.0], []
    monkeypatch.setattr("carstage_sim.server.time.monotonic", lambda: clock_s[0])
    monkeypatch.setattr(
        "carstage_sim.server.give_back_freed_memory", lambda: given_back.append(clock_s[0])
    )
    with serving(lambda _: None) as (server, _):
        for began_s in (100.0, 200.0):
            clock_s[0] = began_s
            for _ in range(5):
                server._serve(Disconnected(cast(Connection, object())))
                server._run_due()
            clock_s[0] += 5.0
            for _ in range(2):
                server._run_due()
    assert given_back == [105.0, 205.0]


@pytest.mark.parametrize(
    ("pace_hz", "ticked_at_s"), [(None, [0.0, 0.0, 0.0]), (4.0, [0.0, 0.25, 0.5])]
)
def test_a_pace_keeps_ticks_apart_and_calls_are_served_meanwhile(
    monkeypatch: pytest.MonkeyPatch, pace_hz: float | None, ticked_at_s: list[float]
) -> None:
    clock_s = [100.0]
    ticks: list[float] = []
    waits: list[float] = []
    monkeypatch.setattr("carstage_sim.server.time.monotonic", lambda: clock_s[0])
    with serving(lambda _: None, pace_hz) as (server, _):

        def serve_one(timeout_s: float) -> bool:
            waits.append(timeout_s)
            clock_s[0] += timeout_s
            return False

        def tick() -> None:
            ticks.append(clock_s[0] - 100.0)

        monkeypatch.setattr(server, "_serve_one", serve_one)
        monkeypatch.setattr(server, "_tick", tick)
        connection = SimpleNamespace(number=1)
        asks_again = cast(Any, SimpleNamespace(connection=connection))  # at once
        server._tick_requests.append(TickRequest(asks_again, time.monotonic()))
        while len(ticks) < 3:
            server._run_when_told()
    assert ticks == pytest.approx(ticked_at_s)
    assert bool(waits) == (pace_hz is not None)
