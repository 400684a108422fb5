"""The connection to the server: retries with a deadline."""

from __future__ import annotations

import logging
import os
import time
from typing import Any, List, Tuple

import carla

from carstage.collector.internals.errors import ConnectionFailedError
from carstage.collector.internals.plan import ServerPlan
from carstage.collector.internals.stopping import StopRequest

RETRY_INTERVAL_S = 0.2
PROBE_TIMEOUT_S = 2.0
_RECORD = ".dist-info"

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
    folder = os.path.dirname(os.path.dirname(os.path.abspath(str(carla.__file__))))
    name = "carla-"
    # As pip names its record; `importlib.metadata` would take 16 ms to be loaded.
    names: List[str] = os.listdir(folder) if os.path.isdir(folder) else []
    beside = [one for one in names if one.startswith(name) and one.endswith(_RECORD)]
    if len(beside) == 1:
        return beside[0][len(name) : -len(_RECORD)]
    from importlib.metadata import PackageNotFoundError, version

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


def versions(client: Any) -> Tuple[str, str]:
    """What client and server say that they are."""
    return str(client.get_client_version()), str(client.get_server_version())


def is_known_gone(world: Any, actor: Any) -> bool:
    """Whether the last frame that a client has seen shows that an actor is gone.

    ``is_alive`` does not tell: of an actor that is not in the frame, LibCarla reads a number that
    nobody has set (``actor_state`` in ``ActorSnapshot.h``). A client that has seen no frame yet
    knows nothing.
    """
    snapshot = world.get_snapshot()
    return bool(snapshot.frame) and snapshot.find(actor.id) is None
