"""Stream tokens: where a client finds the data of one stream."""

from __future__ import annotations

import struct

_LAYOUT = struct.Struct("<IHBB16s")
_TCP = 1
_ADDRESS_OF_THE_RPC_HOST = 0


def stream_token(stream_id: int, port: int) -> bytes:
    """The 24 bytes that send a client to ``stream_id`` on ``port`` of the host it talks to.

    The address is left unset: the client then uses the host that it was constructed with, which
    is right behind port forwarding and name changes too.
    """
    return _LAYOUT.pack(stream_id, port, _TCP, _ADDRESS_OF_THE_RPC_HOST, b"")
