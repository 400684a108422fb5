"""The connection to the server: retries with a deadline, versions compared before anything else."""

from __future__ import annotations

import logging
import re
import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Iterable, Tuple

import carla

from carstage.collector.errors import ConnectionFailedError, VersionMismatchError
from carstage.collector.plan import ServerPlan
from carstage.collector.stopping import StopRequest

RETRY_INTERVAL_S = 0.2
PROBE_TIMEOUT_S = 2.0

_NUMBERS = re.compile(r"(\d+)\.(\d+)\.(\d+)")
_log = logging.getLogger(__name__)


def connect(server: ServerPlan, stop: StopRequest) -> Any:
    """Connect to the planned server; return a ``carla.Client`` that has had an answer.

    Raises:
        ConnectionFailedError: nobody answered within ``server.timeout_s``.
        InterruptedByRequestError: somebody asked to end.
    """
    deadline_s = time.monotonic() + server.timeout_s
    while True:
        stop.check()
        left_s = max(0.1, deadline_s - time.monotonic())
        try:
            client = carla.Client(server.host, server.port)
            client.set_timeout(min(left_s, PROBE_TIMEOUT_S))
            client.get_server_version()
        except RuntimeError as error:
            if time.monotonic() >= deadline_s:
                raise ConnectionFailedError(
                    "No CARLA server answered at %s:%d within %g s: %s"
                    % (server.host, server.port, server.timeout_s, error),
                    "Check that it runs, its port, and its log.",
                ) from error
            _log.info("no answer at %s:%d yet", server.host, server.port)
            stop.wait(RETRY_INTERVAL_S)
        else:
            client.set_timeout(server.timeout_s)
            return client


def client_version() -> str:
    """The version of the ``carla`` wheel of this Python."""
    try:
        return version("carla")
    except PackageNotFoundError:
        return "unknown"  # an egg on the path, as old releases have it


def answers(client: Any, timeout_s: float) -> bool:
    """Whether the server answers now; ``timeout_s`` is the client's timeout afterwards."""
    client.set_timeout(PROBE_TIMEOUT_S)
    try:
        client.get_server_version()
    except RuntimeError:
        return False
    finally:
        client.set_timeout(timeout_s)
    return True


def check_versions(client: Any, dialects: Iterable[str]) -> Tuple[str, str]:
    """Compare client, server and the planned dialects; return client's and server's version.

    Raises:
        VersionMismatchError: they differ in their numbers.
    """
    ours = client.get_client_version()
    server_version = client.get_server_version()
    numbers = release_numbers(ours)
    if release_numbers(server_version) != numbers:
        raise VersionMismatchError(
            "The server is CARLA %s, the carla wheel of this Python is %s."
            % (server_version, ours),
            "Run the collector under a Python that has the wheel of the server's version.",
        )
    for dialect in dialects:
        if release_numbers(dialect) != numbers:
            raise VersionMismatchError(
                "The episode is planned for CARLA %s, the server is %s."
                % (dialect, server_version),
                "Plan the run anew for this server.",
            )
    return ours, server_version


def release_numbers(text: str) -> Tuple[int, ...]:
    """The release's numbers of a version text: ``0.9.15-dirty`` is ``(0, 9, 15)``."""
    match = _NUMBERS.search(text)
    return tuple(int(number) for number in match.groups()) if match else ()
