"""The settings of ``carstage gui``, and where it keeps its own state."""

from __future__ import annotations

import secrets
import socket
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

STATE_FOLDER = ".carstage-gui"
EVERY_ADDRESS = ("0.0.0.0", "::")
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class WebSettings:
    """How the server is reached, and what it may touch.

    Attributes:
        roots: folders whose datasets are shown; new ones are made in the first.
        host: address that it binds.
        port: port that it binds.
        token: what every request must prove to know; None: nobody is asked.
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
        """The address to open, with the token where one is needed; it works from elsewhere, too."""
        host = address_of_this_machine(self.host) if self.host in EVERY_ADDRESS else self.host
        host = f"[{host}]" if ":" in host else host
        tail = f"?token={self.token}" if self.token else ""
        return f"http://{host}:{self.port}/{tail}"


def address_of_this_machine(every: str) -> str:
    """An address by which others reach a server that listens on every one; else loopback's.

    Args:
        every: ``0.0.0.0`` or ``::``.
    """
    import psutil

    family = socket.AF_INET6 if ":" in every else socket.AF_INET
    stats = psutil.net_if_stats()
    for name, addresses in sorted(psutil.net_if_addrs().items()):
        if name not in stats or not stats[name].isup:
            continue
        for address in (found.address for found in addresses if found.family == family):
            # Those with a zone (fe80::1%eth0) are this link's alone.
            if "%" not in address and not ip_address(address).is_loopback:
                return address
    return "::1" if ":" in every else "127.0.0.1"


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address."""
    return host in LOOPBACK


def new_token() -> str:
    """A token for a server that others can reach."""
    return secrets.token_urlsafe(24)
