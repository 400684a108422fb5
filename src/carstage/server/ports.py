"""Free ports: a block of three for a server, one for the client's Traffic Manager."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass

from carstage.errors import BadInputError, ServerError

FIRST_PORT = 20_000
LAST_PORT = 31_999
"""Below the range from which Linux serves outgoing connections: a client that opens one between
our look and the server's bind cannot take the port away."""

BLOCK = 3
"""Ports of a CARLA release: RPC, streaming and secondary, in a row."""

_TRIES = 200
_FEWEST = 8
"""Ports of the smallest range: a block, the Traffic Manager's, and some that are taken."""
_ANY_ADDRESS = "0.0.0.0"


@dataclass(frozen=True, slots=True)
class PortBlock:
    """The ports of one server: RPC, streaming and secondary follow one another."""

    rpc: int
    traffic_manager: int

    @property
    def streaming(self) -> int:
        """The port of the sensor streams."""
        return self.rpc + 1

    @property
    def secondary(self) -> int:
        """The port for secondary servers; clients never use it."""
        return self.rpc + 2


@dataclass(frozen=True, slots=True)
class PortRange:
    """Ports that may be taken, the last one included.

    Two servers that look for ports at the same time never take each other's where they look in
    ranges of their own: between a look and the server's bind a range has no other user.
    """

    first: int = FIRST_PORT
    last: int = LAST_PORT

    def share(self, number: int, count: int) -> PortRange:
        """The ``number``-th of ``count`` equal parts, from 1; parts of fewer than 8 are shared."""
        count = max(1, min(count, (self.last - self.first + 1) // _FEWEST))
        size = (self.last - self.first + 1) // count
        first = self.first + (number - 1) % count * size
        return PortRange(first, first + size - 1)


ANY_PORTS = PortRange()


def allot_ports(
    rpc: int | None = None, host: str = "127.0.0.1", within: PortRange = ANY_PORTS
) -> PortBlock:
    """Find the ports of a server: ``rpc`` and the two after it, and one for the Traffic Manager.

    Args:
        rpc: the wanted RPC port; None finds a free block.
        host: the address that the server will listen on.
        within: where to look for a free block, and for the Traffic Manager's port.

    Raises:
        BadInputError: ``rpc`` or one of the two after it is taken; names ``server.port``.
        ServerError: no free block was found.
    """
    if rpc is not None:
        check_ports_free(range(rpc, rpc + BLOCK), host)
        return PortBlock(rpc, free_port(exclude=range(rpc, rpc + BLOCK), within=within))
    chance = random.SystemRandom()
    for _ in range(_TRIES):
        first = chance.randrange(within.first, within.last - BLOCK + 2)
        block = range(first, first + BLOCK)
        if _taken(block, host) is None and _taken(block, _ANY_ADDRESS) is None:
            return PortBlock(first, free_port(exclude=block, within=within))
    raise ServerError(
        f"No three free ports in a row between {within.first} and {within.last}.",
        "End some of the servers on this machine.",
    )


def free_port(exclude: Iterable[int] = (), within: PortRange = ANY_PORTS) -> int:
    """A port that nobody on this machine listens on.

    Args:
        exclude: ports that are not to be taken.
        within: where to look.

    Raises:
        ServerError: none was found.
    """
    chance = random.SystemRandom()
    excluded = set(exclude)
    for _ in range(_TRIES):
        port = chance.randint(within.first, within.last)
        if port not in excluded and _taken([port], _ANY_ADDRESS) is None:
            return port
    raise ServerError(
        f"No free port between {within.first} and {within.last}.",
        "End some of the servers on this machine.",
    )


def check_ports_free(ports: Iterable[int], host: str = "127.0.0.1") -> None:
    """Refuse ports that somebody listens on already.

    Raises:
        BadInputError: one is taken; names ``server.port``.
    """
    taken = _taken(ports, host)
    if taken is not None:
        raise BadInputError(
            f"server.port: port {taken} on {host} is in use.",
            "Stop what listens there, choose another port, or leave it to `auto`.",
        )


def is_free(port: int, host: str = "127.0.0.1") -> bool:
    """Whether nobody listens on a port."""
    return _taken([port], host) is None


def _taken(ports: Iterable[int], host: str) -> int | None:
    """The first port that cannot be listened on; all are bound at once while looking."""
    with ExitStack() as bound:
        for port in ports:
            listener = bound.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            # A port whose last connections are still closing is free for a server.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((host, port))
                listener.listen(1)
            except (OSError, OverflowError):
                return port
    return None
