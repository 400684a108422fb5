"""A proxy between collector and server that disturbs what sensors send.

It listens at another address of this machine, on the server's own ports: the client looks for the
streams at the host that it connected to, under the port that the server names. A stream's
connection begins with the client's 4 bytes of stream id; then the server sends messages, each after
its length (u32).
"""

from __future__ import annotations

import asyncio
import random
import struct
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import TracebackType
from typing import Protocol

_SERVER_HOST = "127.0.0.1"
_ID = struct.Struct("<I")
_LENGTH = struct.Struct("<I")
_WORLD_STREAM = 1
_CHUNK_BYTES = 1 << 16
_SWAP_PATIENCE_S = 1.0
"""How long a message waits for the one that shall overtake it: after the last there is none."""

Send = Callable[[bytes], Awaitable[None]]


class Disturbance(Protocol):
    """What happens to the messages of one stream."""

    async def pass_on(self, message: bytes, send: Send) -> None:
        """Send the message, or not, or later, or twice; called for one after the other."""


class Late:
    """One message is held back, and with it what comes after it on the same stream."""

    def __init__(self, nth: int, delay_s: float) -> None:
        self._left = nth
        self._delay_s = delay_s

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        self._left -= 1
        if self._left == 0:
            await asyncio.sleep(self._delay_s)  # lateness is what this is for
        await send(message)


class Silent:
    """From one message on, nothing comes any more; the connection stays open."""

    def __init__(self, nth: int) -> None:
        self._left = nth

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        self._left -= 1
        if self._left > 0:
            await send(message)


class Cut:
    """The connection breaks off at one message; the client connects anew."""

    def __init__(self, nth: int) -> None:
        self._left = nth

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        self._left -= 1
        if self._left == 0:
            raise ConnectionResetError("cut on purpose")
        await send(message)


class Doubled:
    """Some messages come twice."""

    def __init__(self, rng: random.Random, share: float) -> None:
        self._rng = rng
        self._share = share

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        await send(message)
        if self._rng.random() < self._share:
            await send(message)


class Swapped:
    """Some messages come after the one that follows them."""

    def __init__(self, rng: random.Random, share: float) -> None:
        self._rng = rng
        self._share = share
        self._held: bytes | None = None
        self._release: asyncio.Task[None] | None = None

    async def pass_on(self, message: bytes, send: Send) -> None:
        """See ``Disturbance``."""
        if self._held is not None:
            await send(message)
            await self._send_held(send)
        elif self._rng.random() < self._share:
            self._held = message
            self._release = asyncio.create_task(self._send_in_time(send))
        else:
            await send(message)

    async def _send_in_time(self, send: Send) -> None:
        held = self._held
        await asyncio.sleep(_SWAP_PATIENCE_S)  # unless another message comes
        if self._held is held:
            with suppress(ConnectionError):
                await self._send_held(send)

    async def _send_held(self, send: Send) -> None:
        held, self._held = self._held, None
        if held is not None:
            await send(held)


class DisturbedStreams:
    """Passes on what a server and its clients say, sensors' messages with a disturbance.

    A context manager; the connections are closed when it is left.

    Args:
        host: address to listen on, another one of this machine than the server's.
        port: the server's RPC port.
        streaming_port: of its streams.
        disturb: the disturbance of the n-th stream of a sensor, from 0; None passes it on as it is.
    """

    def __init__(
        self,
        host: str,
        port: int,
        streaming_port: int,
        disturb: Callable[[int], Disturbance | None],
    ) -> None:
        self.host = host
        self._port = port
        self._streaming_port = streaming_port
        self._disturb = disturb
        self._streams = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="disturbed streams")
        self._servers: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self.disturbed = 0
        """Streams that got a disturbance so far."""

    def __enter__(self) -> DisturbedStreams:
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
        for port, serve in ((self._port, self._calls), (self._streaming_port, self._stream)):
            self._servers.append(await asyncio.start_server(self._counted(serve), self.host, port))

    async def _hang_up(self) -> None:
        for server in self._servers:
            server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    def _counted(
        self, serve: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
    ) -> Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]:
        async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            try:
                await serve(reader, writer)
            except (OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
                pass  # one side has gone, and so does the connection
            finally:
                writer.close()

        return connected

    async def _calls(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection(_SERVER_HOST, self._port)
        try:
            await _first_of(_copy(reader, server_writer), _copy(server_reader, writer))
        finally:
            server_writer.close()

    async def _stream(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        greeting = await reader.readexactly(_ID.size)
        server_reader, server_writer = await asyncio.open_connection(
            _SERVER_HOST, self._streaming_port
        )
        try:
            server_writer.write(greeting)
            await server_writer.drain()
            disturbance = None
            if _ID.unpack(greeting)[0] != _WORLD_STREAM:
                disturbance = self._disturb(self._streams)
                self._streams += 1
                self.disturbed += disturbance is not None
            await _first_of(
                _copy(reader, server_writer),
                _copy(server_reader, writer)
                if disturbance is None
                else _pass_messages(server_reader, writer, disturbance),
            )
        finally:
            server_writer.close()


async def _first_of(*ways: Awaitable[None]) -> None:
    """Wait until one way ends, then end the other; raises what ended it."""
    tasks = [asyncio.ensure_future(way) for way in ways]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _pass_messages(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, disturbance: Disturbance
) -> None:
    async def send(message: bytes) -> None:
        writer.write(_LENGTH.pack(len(message)) + message)
        await writer.drain()

    while True:
        (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
        await disturbance.pass_on(await reader.readexactly(length), send)


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while chunk := await reader.read(_CHUNK_BYTES):
        writer.write(chunk)
        await writer.drain()
