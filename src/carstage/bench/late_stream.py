"""A proxy on the way from server to client that holds one message of one sensor back."""

from __future__ import annotations

import asyncio
import struct
import threading
from collections.abc import Awaitable, Callable
from types import TracebackType

HOST = "127.0.0.2"
"""Another address of this machine: the client looks for streams at the host that it connected to,
under the port that the server names."""

_LENGTH = struct.Struct("<I")
_FRAME = struct.Struct("<Q")
_FRAME_AT = 8  # behind the sensor's type, u64
_HEADER_BYTES = 64
"""At most so many bytes stand before a camera's pixels (60 in 0.9.13 to 0.9.16)."""

_CHUNK_BYTES = 1 << 16

Pump = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class LateStream:
    """Passes everything on, but one message of one camera late; a context manager.

    Args:
        port: RPC port of the server on 127.0.0.1, and of the proxy.
        streaming_port: likewise.
        payload_bytes: the camera is the one whose pictures have so many bytes.
        nth: which of its messages, from 1.
        delay_s: how long it is held back; what the sensor sends after it waits behind it.
    """

    def __init__(
        self, port: int, streaming_port: int, *, payload_bytes: int, nth: int, delay_s: float
    ) -> None:
        self._ports: dict[int, Pump] = {port: _copy, streaming_port: self._copy_messages}
        self._payload_bytes = payload_bytes
        self._nth = nth
        self._delay_s = delay_s
        self._seen = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="late stream")
        self._servers: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self.frame: int | None = None
        """The frame of the message that was late, once it came by."""

    def __enter__(self) -> LateStream:
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        asyncio.run_coroutine_threadsafe(self._hang_up(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _listen(self) -> None:
        for port, pump in self._ports.items():
            self._servers.append(
                await asyncio.start_server(self._connector(port, pump), HOST, port)
            )

    async def _hang_up(self) -> None:
        for server in self._servers:
            server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _connector(
        self, port: int, pump: Pump
    ) -> Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]:
        async def connect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            self._tasks.add(task)
            try:
                server_reader, server_writer = await asyncio.open_connection("127.0.0.1", port)
                await asyncio.gather(_copy(reader, server_writer), pump(server_reader, writer))
            except (ConnectionError, asyncio.IncompleteReadError, asyncio.CancelledError):
                writer.close()  # either side has gone: so does the connection
            finally:
                self._tasks.discard(task)

        return connect

    async def _copy_messages(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        try:
            while True:
                head = await reader.readexactly(_LENGTH.size)
                (length,) = _LENGTH.unpack(head)
                message = await reader.readexactly(length)
                if 0 <= length - self._payload_bytes <= _HEADER_BYTES:
                    await self._hold_back(message)
                writer.write(head + message)
                await writer.drain()
        finally:
            writer.close()

    async def _hold_back(self, message: bytes) -> None:
        self._seen += 1
        if self._seen == self._nth:
            (self.frame,) = _FRAME.unpack_from(message, _FRAME_AT)
            await asyncio.sleep(self._delay_s)  # lateness is what this is for


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        while chunk := await reader.read(_CHUNK_BYTES):
            writer.write(chunk)
            await writer.drain()
    finally:
        writer.close()
