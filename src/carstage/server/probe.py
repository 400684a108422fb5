"""Asks a server for its version over CARLA's protocol, without the ``carla`` wheel.

One msgpack-rpc call: request ``[0, id, "version", [[false]]]`` (the first argument says that the
caller waits), reply ``[1, id, error, [[1, version]]]``.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import Any

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
    deadline_s = time.monotonic() + timeout_s
    try:
        with socket.create_connection((host, port), timeout=timeout_s) as connection:
            connection.sendall(msgpack.packb([0, _CALL_ID, "version", [[False]]]))
            reply = _reply(connection, deadline_s)
    except OSError as error:
        raise ServerError(f"No CARLA server answers at {host}:{port}: {error}.") from error
    except (ValueError, msgpack.UnpackException) as error:
        raise ServerError(f"What listens at {host}:{port} is not CARLA: {error}.") from error
    match reply:
        case [1, int(), None, [[1, str(version)]]]:
            return version
    raise ServerError(f"What listens at {host}:{port} is not CARLA: it answered {reply!r:.80}.")


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
    deadline_s = time.monotonic() + timeout_s
    pause_s = 0.05
    while True:
        left_s = deadline_s - time.monotonic()
        try:
            return probe_version(host, port, max(0.1, min(ONE_TRY_S, left_s)))
        except ServerError as error:
            if left_s <= 0:
                raise ServerError(f"{error.message} Waited {timeout_s:g} s.") from error
        if wait_s(min(pause_s, left_s)):
            raise ServerError(f"The server at {host}:{port} ended before it answered.")
        pause_s = min(2 * pause_s, 1.0)


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
