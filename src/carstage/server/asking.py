"""What a running CARLA server offers, asked over its own protocol, without the client wheel.

msgpack-rpc: request ``[0, id, name, [[false]]]`` (the first argument says that the caller waits),
reply ``[1, id, error, [1, value]]``.
"""

from __future__ import annotations

import socket
from typing import Any

import msgpack
import numpy as np

from carstage.errors import ServerError
from carstage.geometry import FloatArray
from carstage.plan import ServerFacts
from carstage.releases import release_of

#: The server gives the spawn points of its current map only. On every map the first ones are drawn
#: from, which every town of CARLA has: the plan must not depend on what happens to be loaded.
SURELY_THERE = 50
#: How many the embedded simulator's own towns have: a plan is the same for one that is started and
#: for one that runs at an address.
BUILT_IN = {"Stage01": 214, "Stage02": 451, "Stage03": 1329}
_READ_BYTES = 1 << 16
_LONGEST_REPLY_BYTES = 64 << 20


def ask_server(host: str, port: int, version: str, timeout_s: float = 20.0) -> ServerFacts:
    """Maps and blueprints of a server.

    Args:
        host: its address.
        port: its RPC port.
        version: the CARLA version that it reports.
        timeout_s: for each answer.

    Raises:
        ServerError: it does not answer as a CARLA server does.
    """
    try:
        with socket.create_connection((host, port), timeout=timeout_s) as connection:
            names = [str(name) for name in _call(connection, 1, "get_available_maps")]
            current, spawn_points = _call(connection, 2, "get_map_info")[:2]
            definitions = _call(connection, 3, "get_actor_definitions")
            loaded, count = _short(str(current)), len(spawn_points)
            maps = {
                name: BUILT_IN.get(name, SURELY_THERE) for name in [*map(_short, names), loaded]
            }
            maps[loaded] = min(count, maps[loaded])
            blueprints = {
                str(blueprint): {str(one[0]): str(one[2]) for one in attributes}
                for _, blueprint, _, attributes in definitions
            }
    except (OSError, ValueError, TypeError, IndexError, msgpack.UnpackException) as error:
        raise ServerError(
            f"The server at {host}:{port} did not answer what it offers: {error}.",
            "Is it CARLA 0.9.13 or later, and has it finished starting?",
        ) from error
    return ServerFacts(
        maps=maps,
        blueprints=blueprints,
        dialect=str(release_of(version) or version),
        spawn_points={**{n: BUILT_IN[n] for n in maps if n in BUILT_IN}, loaded: count},
    )


def ask_spawn_points(host: str, port: int, timeout_s: float = 20.0) -> tuple[str, FloatArray]:
    """The map that a server has loaded, and its spawn points.

    Returns:
        The map's name without folders, and ``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg).

    Raises:
        ServerError: it does not answer as a CARLA server does.
    """
    try:
        with socket.create_connection((host, port), timeout=timeout_s) as connection:
            name, places = _call(connection, 1, "get_map_info")[:2]
            points = np.array([[*at, *turned] for at, turned in places], dtype=np.float64)
    except (OSError, ValueError, TypeError, IndexError, msgpack.UnpackException) as error:
        raise ServerError(
            f"The server at {host}:{port} did not answer what its map is: {error}.",
            "Is it CARLA 0.9.13 or later, and has it finished starting?",
        ) from error
    return _short(str(name)), points.reshape(-1, 6)


def _short(name: str) -> str:
    return name.rsplit("/", 1)[-1]


def _call(connection: socket.socket, call_id: int, method: str) -> Any:
    connection.sendall(msgpack.packb([0, call_id, method, [[False]]]))
    unpacker = msgpack.Unpacker(max_buffer_size=_LONGEST_REPLY_BYTES, raw=False)
    while True:
        data = connection.recv(_READ_BYTES)
        if not data:
            raise ConnectionResetError(f"the connection was closed at {method}")
        unpacker.feed(data)
        for reply in unpacker:
            match reply:
                case [1, int(answered), None, [[1, value]]] if answered == call_id:
                    return value
                case [1, int(answered), None, [1, value]] if answered == call_id:
                    return value
            raise ValueError(f"{method} was answered with {reply!r:.80}")
