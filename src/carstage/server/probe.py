"""Asks a server for its version over CARLA's protocol, without the ``carla`` wheel.

One msgpack-rpc call: request ``[0, id, "version", [[false]]]`` (the first argument says that the
caller waits), reply ``[1, id, error, [[1, version]]]``.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import Any, TypeVar

import msgpack

from carstage.errors import ServerError

ONE_TRY_S = 2.0
_CALL_ID = 1
_LONGEST_REPLY_BYTES = 1 << 16


def probe_version(host: str, port: int, timeout_s: float = ONE_TRY_S) -> str:
    """The CARLA version that the server at ``host:port`` reports.

    Raises:
        ServerError: nobody listens, or what listens does not answer as a CARLA server.
    """
    reply = _ask("version", host, port, timeout_s)
    match reply:
        case [1, int(), None, [[1, str(version)]]]:
            return version
    raise ServerError(f"What listens at {host}:{port} is not CARLA: it answered {reply!r:.80}.")


def probe_world(host: str, port: int, timeout_s: float = ONE_TRY_S) -> None:
    """Ask for something that only the simulation's own thread answers: there is a world.

    CARLA gives its version from another thread, while the first map is still being loaded.

    Raises:
        ServerError: it does not answer, or has no world yet.
    """
    reply = _ask("get_episode_settings", host, port, timeout_s)
    match reply:
        case [1, int(), None, [[1, _]] | [1, _]]:
            return
    raise ServerError(f"CARLA at {host}:{port} has no world yet: it answered {reply!r:.80}.")


def wait_for_version(
    host: str, port: int, timeout_s: float, wait_s: Callable[[float], bool]
) -> str:
    """Ask until the server answers.

    Args:
        host: its address.
        port: its RPC port.
        timeout_s: give up after that long.
        wait_s: waits that many seconds, less when the server ended; returns whether it ended.

    Raises:
        ServerError: it ended, or did not answer in time.
    """
    return _until_answered(probe_version, ONE_TRY_S, host, port, timeout_s, wait_s)


def wait_for_world(host: str, port: int, timeout_s: float, wait_s: Callable[[float], bool]) -> None:
    """Ask until the server has a world; arguments and errors as in :func:`wait_for_version`."""
    # Each try may take all the time: the question waits in the server until it is free.
    _until_answered(probe_world, timeout_s, host, port, timeout_s, wait_s)


_Answer = TypeVar("_Answer")


def _until_answered(
    ask: Callable[[str, int, float], _Answer],
    one_try_s: float,
    host: str,
    port: int,
    timeout_s: float,
    wait_s: Callable[[float], bool],
) -> _Answer:
    deadline_s = time.monotonic() + timeout_s
    pause_s = 0.05
    while True:
        left_s = deadline_s - time.monotonic()
        try:
            return ask(host, port, max(0.1, min(one_try_s, left_s)))
        except ServerError as error:
            if left_s <= 0:
                raise ServerError(f"{error.message} Waited {timeout_s:g} s.") from error
        if wait_s(min(pause_s, left_s)):
            raise ServerError(f"The server at {host}:{port} ended before it answered.")
        pause_s = min(2 * pause_s, 1.0)


def _ask(method: str, host: str, port: int, timeout_s: float) -> Any:
    """The reply to one call without arguments.

    Raises:
        ServerError: nobody listens, or what listens does not speak msgpack-rpc.
    """
    deadline_s = time.monotonic() + timeout_s
    try:
        with socket.create_connection((host, port), timeout=timeout_s) as connection:
            connection.sendall(msgpack.packb([0, _CALL_ID, method, [[False]]]))
            return _reply(connection, deadline_s)
    except OSError as error:
        raise ServerError(f"No CARLA server answers at {host}:{port}: {error}.") from error
    except (ValueError, msgpack.UnpackException) as error:
        raise ServerError(f"What listens at {host}:{port} is not CARLA: {error}.") from error


def _reply(connection: socket.socket, deadline_s: float) -> Any:
    unpacker = msgpack.Unpacker(max_buffer_size=_LONGEST_REPLY_BYTES, raw=False)
    while True:
        connection.settimeout(max(0.01, deadline_s - time.monotonic()))
        data = connection.recv(4096)
        if not data:
            raise ConnectionResetError("the connection was closed")
        try:
            unpacker.feed(data)
        except msgpack.BufferFull as error:
            raise ValueError("its answer does not end") from error
        for reply in unpacker:
            return reply
