"""What a server offers does not depend on the map that it happens to have loaded."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import pytest

from carstage.config import parse_config
from carstage.errors import ServerError
from carstage.plan import plan_episodes
from carstage.runs.servers import ServerSetup
from carstage.server.asking import BUILT_IN, SURELY_THERE, ask_server

TOWNS = {"Town01": 255, "Town02": 101, "Yard": 7}


@contextmanager
def carla_with(loaded: str) -> Iterator[int]:
    """A server that answers what a plan asks, with one of the towns loaded."""
    place = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    answers: dict[str, Any] = {
        "get_available_maps": [f"/Game/Carla/Maps/{name}" for name in TOWNS],
        "get_map_info": [f"Carla/Maps/{loaded}", [place] * TOWNS[loaded]],
        "get_actor_definitions": [],
    }

    def serve(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        unpacker = msgpack.Unpacker()
        with connection:
            while data := connection.recv(4096):
                unpacker.feed(data)
                for _, call_id, method, _ in unpacker:
                    connection.sendall(msgpack.packb([1, call_id, None, [1, answers[method]]]))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve, args=(listener,))
        thread.start()
        yield listener.getsockname()[1]
        thread.join(20.0)


@pytest.mark.parametrize("town", ["Town01", "Town02"])
def test_same_configuration_gives_the_same_episodes_whatever_map_is_loaded(town: str) -> None:
    config = parse_config(f"{{map: {town}, episodes: 20}}")
    ids = []
    for loaded in ("Town01", "Town02"):
        with carla_with(loaded) as port:
            facts = ask_server("127.0.0.1", port, "0.9.16")
        ids.append([spec.episode_id for spec in plan_episodes(config, facts)])
    assert ids[0] == ids[1]


def test_spawn_points_are_known_of_the_loaded_map_only() -> None:
    with carla_with("Yard") as port:
        facts = ask_server("127.0.0.1", port, "0.9.16")
    assert facts.maps == {"Town01": SURELY_THERE, "Town02": SURELY_THERE, "Yard": 7}
    assert [facts.count(name) for name in TOWNS] == [None, None, 7]


def test_own_towns_have_as_many_spawn_points_at_an_address_as_when_started() -> None:
    with ServerSetup(parse_config("{}")).facts() as facts:
        assert {name: facts.maps[name] for name in BUILT_IN} == BUILT_IN


def test_server_that_hangs_up_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(ServerError, match="did not answer what it offers"):
        ask_server("127.0.0.1", port, "0.9.16")
