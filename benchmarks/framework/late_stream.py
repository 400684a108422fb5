"""One picture of one camera, held back on its way from server to client."""

from __future__ import annotations

import asyncio
import struct

from benchmarks.framework.faults.streams import Send

_FRAME = struct.Struct("<Q")
_FRAME_AT = 8  # behind the sensor's type, u64
_HEADER_BYTES = 64
"""At most so many bytes stand before a camera's pixels (60 in 0.9.13 to 0.9.16)."""


class HeldPicture:
    """A disturbance for all streams at once: one message of one camera comes late.

    What the camera sends after it waits behind it.

    Args:
        payload_bytes: the camera is the one whose pictures have so many bytes.
        nth: which of its messages, from 1.
        delay_s: how long it is held back.
    """

    def __init__(self, payload_bytes: int, nth: int, delay_s: float) -> None:
        self._payload_bytes = payload_bytes
        self._left = nth
        self._delay_s = delay_s
        self.frame: int | None = None
        """The frame of the picture that was late, once it came by."""

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        if 0 <= len(message) - self._payload_bytes <= _HEADER_BYTES:
            self._left -= 1
            if self._left == 0:
                (self.frame,) = _FRAME.unpack_from(message, _FRAME_AT)
                await asyncio.sleep(self._delay_s)  # lateness is what this is for
        await send(message)
