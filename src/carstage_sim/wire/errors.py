"""What can go wrong at the wire, as types."""

from __future__ import annotations


class CallError(Exception):
    """A call that is refused; the text reaches the user as the client's ``RuntimeError``."""


class BadAddressError(OSError):
    """An address that the server cannot listen on."""

    def __init__(self, host: str, port: int, reason: str) -> None:
        super().__init__(
            f"cannot listen on {host}:{port}: {reason}; choose another --host or --port"
        )


class PortInUseError(OSError):
    """A port that the server should listen on is taken."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__(
            f"port {port} on {host} is in use: end what listens there, choose another --port "
            f"(the streaming port is the one above it), or let --port 0 find free ones"
        )


class UnknownProtocolError(ValueError):
    """A protocol version without a table."""

    def __init__(self, version: str, known: tuple[str, ...]) -> None:
        super().__init__(f"protocol {version} is not built in; available: {', '.join(known)}")


class MessageError(ValueError):
    """Bytes that are no message of the protocol, or one beyond its limits."""

    def __init__(self, what: str) -> None:
        super().__init__(f"it sent {what}")
