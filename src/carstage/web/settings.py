"""The settings of ``carstage gui``, and where it keeps its own state."""

from __future__ import annotations

import secrets
import socket
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from carstage.cache import cache_folder
from carstage.storage.remote_path import DatasetPath

STATE_FOLDER = ".carstage-gui"
EVERY_ADDRESS = ("0.0.0.0", "::")
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class WebSettings:
    """How the server is reached, and what it may touch.

    Attributes:
        roots: folders, or places in object stores, whose datasets are shown; new ones are made in
            the first.
        host: address that it binds.
        port: port that it binds.
        token: what every request must prove to know; None: nobody is asked.
        work: folder of this machine for raw recordings and logs of runs into object stores; None:
            the user's cache.
    """

    roots: tuple[DatasetPath, ...]
    host: str = "127.0.0.1"
    port: int = 8321
    token: str | None = field(default=None, repr=False)
    work: Path | None = None

    @property
    def home(self) -> Path:
        """The folder of this machine that relative paths are relative to: the first root on it."""
        from carstage.runs.preflight import work_folder

        local = next((root for root in self.roots if isinstance(root, Path)), None)
        return work_folder(self.roots[0], None) if local is None else local

    @property
    def state(self) -> Path:
        """Folder of what outlives this process: configuration, queue, jobs."""
        return self.home / STATE_FOLDER

    @property
    def writable(self) -> tuple[Path, ...]:
        """Folders of this machine, beside the roots, that runs may work in."""
        return (runs_cache(), *([self.work] if self.work else []))

    @property
    def folders(self) -> tuple[Path, ...]:
        """Every folder of this machine whose files are shown, resolved."""
        local = [root for root in self.roots if isinstance(root, Path)]
        found = [*local, self.home, *self.writable]
        return tuple(dict.fromkeys(folder.resolve() for folder in found))

    @property
    def url(self) -> str:
        """The address to open, with the token where one is needed; it works from elsewhere, too."""
        host = address_of_this_machine(self.host) if self.host in EVERY_ADDRESS else self.host
        host = f"[{host}]" if ":" in host else host
        tail = f"?token={self.token}" if self.token else ""
        return f"http://{host}:{self.port}/{tail}"


def runs_cache() -> Path:
    """What holds the work folders of runs into object stores."""
    return cache_folder() / "runs"


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
