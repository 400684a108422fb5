"""The settings of ``carstage gui``, and where it keeps its own state."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from pathlib import Path

STATE_FOLDER = ".carstage-gui"
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class WebSettings:
    """How the server is reached, and what it may touch.

    Attributes:
        roots: folders whose datasets are shown; new ones are made in the first.
        host: address that it binds.
        port: port that it binds.
        token: what every request must prove to know; None: none, as on loopback.
    """

    roots: tuple[Path, ...]
    host: str = "127.0.0.1"
    port: int = 8321
    token: str | None = field(default=None, repr=False)

    @property
    def root(self) -> Path:
        """The folder in which datasets are made."""
        return self.roots[0]

    @property
    def state(self) -> Path:
        """Folder of what outlives this process: configuration, queue, jobs."""
        return self.root / STATE_FOLDER

    @property
    def url(self) -> str:
        """The address to open, with the token where one is needed."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        tail = f"?token={self.token}" if self.token else ""
        return f"http://{host}:{self.port}/{tail}"


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address."""
    return host in LOOPBACK


def new_token() -> str:
    """A token for a server that others can reach."""
    return secrets.token_urlsafe(24)
