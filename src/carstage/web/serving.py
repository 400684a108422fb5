"""Runs the server until Ctrl-C: one process, one port, one state folder."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import uvicorn

from carstage.errors import BadInputError
from carstage.files.home import without_tilde
from carstage.files.locks import take_lock
from carstage.storage.remote_files import remote_files
from carstage.storage.remote_path import DatasetPath
from carstage.web.app import create_app
from carstage.web.settings import WebSettings, is_loopback, new_token

_GRACE_S = 3
_MOST_CONNECTIONS = 256
"""More are answered with 503; a page keeps fewer than ten."""
_LARGEST_MESSAGE_BYTES = 65_536


def serve(
    roots: Sequence[DatasetPath],
    host: str,
    port: int,
    ready: Callable[[str], None],
    *,
    token: bool = True,
    work: Path | None = None,
) -> None:
    """Serve until SIGINT or SIGTERM.

    Args:
        roots: folders of datasets, and places of them in object stores; the first folder is made
            when it is missing.
        host: address to bind.
        port: port to bind; 0: a free one.
        ready: called with the address to open, when the server listens.
        token: whether everybody has to know the token in that address. Other users of this machine
            reach loopback, too, and who may start runs may start programs.
        work: folder of this machine for raw recordings of runs into object stores.

    Raises:
        BadInputError: no token, and not on loopback; the address is taken or not ours, or a folder
            cannot be used.
        StoreAccessError: there is no such bucket, or the credentials let nobody look.
        StorageError: a store cannot be reached.
    """
    if not token and not is_loopback(host):
        raise BadInputError(
            f"--no-token: everybody who reaches {host} could start programs here.",
            "Leave it out, or listen on 127.0.0.1 alone.",
        )
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    places = tuple(_place(root, make=number == 0) for number, root in enumerate(roots))
    listener = _listen(host, port)
    with listener:
        bound = WebSettings(
            roots=places,
            host=host,
            port=listener.getsockname()[1],
            token=new_token() if token else None,
            work=None if work is None else _folder(work, make=True),
        )
        # Ctrl-C is how it ends; the server has closed everything before it passes the signal on.
        with _only_server(bound.state), suppress(KeyboardInterrupt):
            _Server(bound, ready).run(sockets=[listener])


class _Server(uvicorn.Server):
    """Calls ``ready`` when it listens. Its own log stays silent: addresses hold the token."""

    def __init__(self, settings: WebSettings, ready: Callable[[str], None]) -> None:
        super().__init__(
            uvicorn.Config(
                create_app(settings),
                log_config=None,
                log_level="warning",
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=_GRACE_S,
                limit_concurrency=_MOST_CONNECTIONS,
                ws="websockets-sansio",
                ws_max_size=_LARGEST_MESSAGE_BYTES,
                # Previews are JPEG already, and must not wait.
                ws_per_message_deflate=False,
                proxy_headers=False,
            )
        )
        self._url = settings.url
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._ready(self._url)


def _place(root: DatasetPath, *, make: bool) -> DatasetPath:
    if isinstance(root, Path):
        return _folder(root, make=make)
    remote_files(root.root).listing(root.key)  # whether there is such a bucket, and we may look
    return root


def _folder(root: Path, *, make: bool) -> Path:
    root = without_tilde(root).absolute()
    try:
        if make:
            root.mkdir(parents=True, exist_ok=True)
        if not root.is_dir():
            raise BadInputError(f"{root} is not a folder.", "Name a folder of datasets.")
    except OSError as error:
        raise BadInputError(
            f"{root} cannot be used: {error.strerror}.", "Name another folder by --datasets."
        ) from error
    return root


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With the protocol named, asyncio sends small answers at once instead of 40 ms later.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise BadInputError(
            f"{host}:{port} cannot be listened on: {error.strerror or error}.",
            "Choose another --port or --host; is another `carstage gui` running?",
        ) from error
    return listener


@contextmanager
def _only_server(state: Path) -> Iterator[None]:
    """Hold the state folder; the system gives it back with the process, however that ends."""
    try:
        state.mkdir(mode=0o700, parents=True, exist_ok=True)
        held = take_lock(state / "lock", 0o600)
    except OSError as error:
        raise BadInputError(
            f"{state} cannot be used: {error.strerror}.", "Name another folder by --datasets."
        ) from error
    if held is None:
        raise BadInputError(
            f"Another `carstage gui` serves {state.parent}.",
            "Use that one, or name another folder by --datasets.",
        )
    with held:
        yield
