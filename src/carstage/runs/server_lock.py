"""One run per CARLA server: two that step one world would spoil each other's frames."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from carstage.cache import cache_folder
from carstage.config import Config
from carstage.config.servers import ClassServerConfig, RemoteServerConfig
from carstage.errors import BadInputError
from carstage.files.locks import take_lock


def server_key(config: Config) -> str:
    """Equal for configurations whose runs would need one and the same server or its machine."""
    server = config.server
    if isinstance(server, RemoteServerConfig):
        host = "127.0.0.1" if server.host == "localhost" else server.host
        return f"{host}:{server.port}"
    if isinstance(server, ClassServerConfig) or server.port == "auto":
        return "here"
    return f"127.0.0.1:{server.port}"


@contextmanager
def server_lock(config: Config, folder: Path | None = None) -> Iterator[None]:
    """Hold the server of a configuration for as long as this process needs it.

    A server on ports of its own needs no lock. The system gives the lock back with the process, so
    that nothing has to be cleared after one that was killed.

    Args:
        config: whose server.
        folder: where the locks are; default: the cache folder.

    Raises:
        BadInputError: another run on this machine has it.
    """
    key = server_key(config)
    if key == "here":
        yield
        return
    folder = (folder or cache_folder()) / "locks"
    with suppress(OSError):  # a cache that cannot be written guards nothing and hinders nobody
        folder.mkdir(parents=True, exist_ok=True)
    try:
        lock = take_lock(folder / f"server-{re.sub(r'[^A-Za-z0-9.-]', '_', key)}.lock", 0o666)
    except OSError:
        yield
        return
    if lock is None:
        raise BadInputError(
            f"server: another run, or a preview, uses the server at {key}.",
            "Wait for its end, or choose another server or port.",
        )
    with lock:
        yield
