"""Which Traffic Managers run, in whose process.

A Traffic Manager lives in a client and listens there; the server only tells others where.
"""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address

from carstage_sim.wire.rpc import Connection

_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class _Entry:
    host: str
    owner: Connection


class TrafficManagers:
    """The registry, by port. An entry goes when the client that made it is gone."""

    def __init__(self) -> None:
        self._entries: dict[int, _Entry] = {}

    def running(self, port: int) -> bool:
        """Whether a Traffic Manager of that port is known."""
        return port in self._entries

    def where(self, port: int) -> tuple[str, int]:
        """Host and port of a Traffic Manager; an empty host and port 0 if there is none."""
        entry = self._entries.get(port)
        return (entry.host, port) if entry is not None else ("", 0)

    def add(self, host: str, port: int, owner: Connection) -> bool:
        """Register one; false if the port is taken.

        Clients give their outward address. One that reached this server over loopback is reached
        over loopback too, also where a firewall guards the outward address.
        """
        if port in self._entries:
            return False
        self._entries[port] = _Entry(_LOOPBACK if _is_loopback(owner.peer) else host, owner)
        return True

    def remove(self, port: int) -> None:
        """Forget one."""
        self._entries.pop(port, None)

    def drop_owner(self, owner: Connection) -> None:
        """Forget those of a client that is gone."""
        self._entries = {
            port: entry for port, entry in self._entries.items() if entry.owner is not owner
        }

    def owned_by(self, owner: Connection) -> bool:
        """Whether a client runs a Traffic Manager."""
        return any(entry.owner is owner for entry in self._entries.values())


def _is_loopback(address: str) -> bool:
    return ip_address(address).is_loopback
