"""Reading a log: an index of its frames, and the packets of each."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from carstage_sim.recording.errors import LogNotFoundError
from carstage_sim.recording.layout import FRAME, HEADER, LogInfo, Packet


@dataclass(frozen=True, slots=True)
class LogFrame:
    """One frame of a log.

    Attributes:
        number: from 1.
        elapsed_s: from the first frame, which is at 0.
        start, end: bytes of its packets in the file.
    """

    number: int
    elapsed_s: float
    start: int
    end: int


class RecordingLog:
    """An open log; a context manager that owns the file.

    Only the index is in memory, so that a log of hours replays as one of seconds does. A frame that
    is cut off, as a writer's death leaves it, is no frame.

    Args:
        path: the file.

    Attributes:
        info: the head.
        frames: the whole frames, in order.

    Raises:
        LogNotFoundError: there is no such file, or it cannot be read.
        NotALogError: it is none.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise LogNotFoundError(path) from error
        try:
            self.info = LogInfo.read(self._file)
            self.frames: list[LogFrame] = list(self._index())
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> RecordingLog:
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the file back; may be called twice."""
        self._file.close()

    @property
    def duration_s(self) -> float:
        """When the last frame was."""
        return self.frames[-1].elapsed_s if self.frames else 0.0

    @property
    def modified_s(self) -> float:
        """When the file was last written, seconds since 1970."""
        return os.fstat(self._file.fileno()).st_mtime

    def _index(self) -> Iterator[LogFrame]:
        file, end = self._file, os.fstat(self._file.fileno()).st_size
        start, number, elapsed_s = -1, 0, 0.0
        while True:
            head = file.read(HEADER.size)
            if len(head) < HEADER.size:
                return
            kind, size = HEADER.unpack(head)
            here = file.tell()
            if here + size > end:
                return
            if kind == Packet.FRAME_START and size >= FRAME.size:
                number, _, elapsed_s = FRAME.unpack(file.read(FRAME.size))
                start = here + size
            elif kind == Packet.FRAME_END and start >= 0:
                yield LogFrame(number, elapsed_s, start, here - HEADER.size)
                start = -1
            file.seek(here + size)

    def packets(self, index: int) -> Iterator[tuple[int, bytes]]:
        """Kind and payload of a frame's packets; kinds that nobody knows are among them."""
        frame = self.frames[index]
        self._file.seek(frame.start)
        block, at = self._file.read(frame.end - frame.start), 0
        while at + HEADER.size <= len(block):
            kind, size = HEADER.unpack_from(block, at)
            at += HEADER.size
            yield kind, block[at : at + size]
            at += size
