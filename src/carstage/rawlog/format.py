"""Bytes of the raw log and its writer; the format is fixed in docs/formats/raw-log.md.

Standard library only, Python 3.8: the collector uses this under whichever interpreter has the
``carla`` wheel that fits the user's server. Layout and writer stay in one module, long as it is: it
is the one file beside the collector's own that such an interpreter has to run.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import re
import struct
import zlib
from typing import Any, List, Mapping, NamedTuple, Optional, Tuple, Union

FORMAT_VERSION = 1
HEADER_BYTES = 64
SEGMENT_MAGIC = b"CSTAGLOG"
RECORD_MAGIC = b"CREC"

KIND_DATA = 1
KIND_SEAL = 2
KIND_TABLE = 3

FLAG_PAYLOAD_CRC = 1

WORLD = "world"
LEDGER = "ledger"
EPISODE_FILE = "episode.json"
SEALED_SUFFIX = ".seg"
OPEN_SUFFIX = ".seg.open"

MAX_SEGMENT_INDEX = 999_999

_SEGMENT_HEADER = struct.Struct("<8sHHI32s12sI")
_RECORD_HEADER = struct.Struct("<4sHHQdIIQIIQII")
_CRC = struct.Struct("<I")
_ALIGNMENT = 8
_STREAM_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,30}\Z")
_SEGMENT_FILE = re.compile(r"(\d{6})\.seg\Z")

ACTOR_RECORD = struct.Struct("<II15f")
"""One actor of a world snapshot: id, reserved, then location, rotation (pitch, yaw, roll in deg),
velocity, angular velocity (deg/s), acceleration; 3 float32 each, world frame."""

IMU_PAYLOAD = struct.Struct("<7d")
"""Accelerometer (m/s^2), gyroscope (rad/s), compass (rad)."""

GNSS_PAYLOAD = struct.Struct("<3d")
"""Latitude (deg), longitude (deg), altitude (m)."""

Buffer = Union[bytes, bytearray, memoryview]


class FormatError(ValueError):
    """Bytes that are not what the format says; carries no file name, the reader adds it."""


class SegmentHeader(NamedTuple):
    """The first 64 bytes of a segment."""

    stream: str
    segment: int


class RecordHeader(NamedTuple):
    """The 64 bytes before each record's meta and payload."""

    kind: int
    frame: int
    timestamp_s: float
    meta_bytes: int
    flags: int
    payload_bytes: int
    payload_crc: int
    sequence: int
    tick: int

    @property
    def record_bytes(self) -> int:
        """Bytes of the whole record in the file: header, meta, payload, padding."""
        return padded(HEADER_BYTES + self.meta_bytes + self.payload_bytes)


class SealedSegment(NamedTuple):
    """A segment that is complete and never changes again.

    ``first_tick`` and ``last_tick`` (inclusive) are the ticks that it covers, ``records`` counts
    data and table records, ``bytes`` is the file's size before the seal record.
    """

    stream: str
    segment: int
    path: str
    first_tick: int
    last_tick: int
    records: int
    bytes: int


def padded(size: int) -> int:
    """Round ``size`` up to the records' alignment of 8 bytes."""
    return -(-size // _ALIGNMENT) * _ALIGNMENT


def check_stream_name(stream: str) -> str:
    """Return ``stream`` when it may name a stream.

    Raises:
        ValueError: when it does not match ``[A-Za-z0-9][A-Za-z0-9_.-]{0,30}``.
    """
    if not _STREAM_NAME.match(stream):
        raise ValueError(
            "stream name %r must match [A-Za-z0-9][A-Za-z0-9_.-]{0,30} (it names a folder)"
            % (stream,)
        )
    return stream


def segment_index(file_name: str) -> Optional[int]:
    """Index of a sealed segment by its file name, ``None`` for any other name."""
    match = _SEGMENT_FILE.match(file_name)
    return int(match.group(1)) if match else None


def pack_segment_header(stream: str, index: int) -> bytes:
    """Build the 64 bytes that begin a segment."""
    name = check_stream_name(stream).encode("utf-8")
    head = _SEGMENT_HEADER.pack(
        SEGMENT_MAGIC, FORMAT_VERSION, HEADER_BYTES, index, name, b"\0" * 12, 0
    )
    return head[:-4] + _CRC.pack(zlib.crc32(head[:-4]))


def unpack_segment_header(data: Buffer) -> SegmentHeader:
    """Read and verify the 64 bytes that begin a segment.

    Raises:
        FormatError: too short, wrong magic, unknown version, or a CRC that does not hold.
    """
    if len(data) < HEADER_BYTES:
        raise FormatError("segment header is cut short at %d bytes" % len(data))
    magic, version, size, index, name, _, crc = _SEGMENT_HEADER.unpack_from(data)
    if magic != SEGMENT_MAGIC:
        raise FormatError("not a segment of a raw log: it begins with %r" % bytes(magic))
    if zlib.crc32(data[: HEADER_BYTES - 4]) != crc:
        raise FormatError("segment header's CRC does not hold")
    if version != FORMAT_VERSION or size != HEADER_BYTES:
        raise FormatError(
            "segment has format version %d; this reads %d" % (version, FORMAT_VERSION)
        )
    return SegmentHeader(name.rstrip(b"\0").decode("utf-8"), index)


def pack_record_header(header: RecordHeader) -> bytes:
    """Build the 64 bytes that begin a record."""
    head = _RECORD_HEADER.pack(
        RECORD_MAGIC,
        header.kind,
        HEADER_BYTES,
        header.frame,
        header.timestamp_s,
        header.meta_bytes,
        header.flags,
        header.payload_bytes,
        header.payload_crc,
        header.sequence,
        header.tick,
        0,
        0,
    )
    return head[:-4] + _CRC.pack(zlib.crc32(head[:-4]))


def unpack_record_header(data: Buffer, offset: int = 0) -> RecordHeader:
    """Read and verify the record header at ``offset``.

    Raises:
        FormatError: too short, wrong magic, or a CRC that does not hold.
    """
    if len(data) - offset < HEADER_BYTES:
        raise FormatError("record header is cut short")
    fields = _RECORD_HEADER.unpack_from(data, offset)
    if fields[0] != RECORD_MAGIC:
        raise FormatError("no record begins here")
    if zlib.crc32(data[offset : offset + HEADER_BYTES - 4]) != fields[12]:
        raise FormatError("record header's CRC does not hold")
    if fields[2] != HEADER_BYTES:
        raise FormatError("record header of %d bytes; this reads %d" % (fields[2], HEADER_BYTES))
    return RecordHeader(
        kind=fields[1],
        frame=fields[3],
        timestamp_s=fields[4],
        meta_bytes=fields[5],
        flags=fields[6],
        payload_bytes=fields[7],
        payload_crc=fields[8],
        sequence=fields[9],
        tick=fields[10],
    )


def encode_meta(meta: Mapping[str, Any]) -> bytes:
    """Encode a record's meta as canonical JSON, padded with spaces to a multiple of 8 bytes.

    The padding (JSON allows it) makes every payload begin 8-byte aligned in the file, so that
    readers can map numbers in place. An empty meta takes no bytes.

    Raises:
        ValueError: for NaN or infinity, which JSON does not have.
    """
    if not meta:
        return b""
    text = json.dumps(
        meta, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    ).encode("utf-8")
    return text.ljust(padded(len(text)), b" ")


class SegmentWriter:
    """Writes one segment: header, records, seal; a context manager that leaves what is unsealed.

    An unsealed segment stays behind as ``NNNNNN.seg.open``, with every record that the kernel was
    given; that is what a crash leaves too.

    Args:
        folder: the stream's folder; it must exist.
        stream: the stream's name.
        index: the segment's number.
        expected_bytes: reserve that much on disk, when the file system can; 0 reserves nothing.
        checksum: also protect payloads by CRC-32; it about doubles the cost of writing.

    Raises:
        FileExistsError: when that segment is there already.
        OSError: whatever the file system says.
    """

    def __init__(
        self,
        folder: str,
        stream: str,
        index: int,
        expected_bytes: int = 0,
        checksum: bool = False,
    ) -> None:
        if not 0 <= index <= MAX_SEGMENT_INDEX:
            raise ValueError("segment index %d is outside 0...%d" % (index, MAX_SEGMENT_INDEX))
        self.stream = stream
        self.index = index
        self.path = os.path.join(folder, "%06d%s" % (index, SEALED_SUFFIX))
        self.open_path = os.path.join(folder, "%06d%s" % (index, OPEN_SUFFIX))
        if os.path.exists(self.path):
            raise FileExistsError(errno.EEXIST, "segment is sealed already", self.path)
        header = pack_segment_header(stream, index)
        self._folder = folder
        self._checksum = checksum
        self._sequence = 0
        self._size = 0
        self._fd = os.open(
            self.open_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644
        )
        try:
            self._reserved = reserve(self._fd, expected_bytes) if expected_bytes > 0 else False
            self._write([header])
        except BaseException:
            self.close()
            raise

    @property
    def size(self) -> int:
        """Bytes written so far, header included."""
        return self._size

    @property
    def records(self) -> int:
        """Data and table records written so far."""
        return self._sequence

    def append(
        self,
        kind: int,
        tick: int,
        frame: int,
        timestamp_s: float,
        meta: Mapping[str, Any],
        payload: Buffer = b"",
    ) -> None:
        """Write one record in one system call; the payload's bytes are not copied.

        Args:
            kind: ``KIND_DATA`` or ``KIND_TABLE``.
            tick: index from the first tick after warm-up.
            frame: the server's frame number.
            timestamp_s: the server's simulated time, s.
            meta: JSON object.
            payload: any contiguous buffer.

        Raises:
            OSError: whatever the file system says; the record then is a torn tail.
        """
        view = memoryview(payload).cast("B") if len(payload) else memoryview(b"")
        meta_bytes = encode_meta(meta)
        header = RecordHeader(
            kind=kind,
            frame=frame,
            timestamp_s=timestamp_s,
            meta_bytes=len(meta_bytes),
            flags=FLAG_PAYLOAD_CRC if self._checksum else 0,
            payload_bytes=view.nbytes,
            payload_crc=zlib.crc32(view) if self._checksum else 0,
            sequence=self._sequence,
            tick=tick,
        )
        padding = header.record_bytes - HEADER_BYTES - header.meta_bytes - header.payload_bytes
        self._write([pack_record_header(header), meta_bytes, view, b"\0" * padding])
        self._sequence += 1

    def seal(self, first_tick: int, last_tick: int) -> SealedSegment:
        """Append the seal record, bring all to the disk, give the file its final name."""
        sealed = SealedSegment(
            self.stream, self.index, self.path, first_tick, last_tick, self._sequence, self._size
        )
        self.append(
            KIND_SEAL,
            last_tick,
            0,
            0.0,
            {
                "records": sealed.records,
                "first_tick": first_tick,
                "last_tick": last_tick,
                "bytes": sealed.bytes,
            },
        )
        if self._reserved:
            os.ftruncate(self._fd, self._size)
        os.fsync(self._fd)
        self.close()
        os.rename(self.open_path, self.path)
        _sync_folder(self._folder)
        return sealed

    def close(self) -> None:
        """Close the file without sealing it; closing twice is fine."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def __enter__(self) -> SegmentWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self, parts: List[Buffer]) -> None:
        buffers = [memoryview(part) for part in parts if len(part)]
        while buffers:
            written = os.pwritev(self._fd, buffers, self._size)
            self._size += written
            # A signal or a nearly full disk may cut a write short: go on where it stopped.
            while buffers and written >= buffers[0].nbytes:
                written -= buffers.pop(0).nbytes
            if buffers and written:
                buffers[0] = buffers[0][written:]


class StreamWriter:
    """Writes one stream of an attempt as a row of segments.

    Not thread-safe: one thread writes a stream.

    Args:
        folder: the attempt's folder; the stream's folder is made below it.
        stream: the stream's name.
        ticks_per_segment: segment ``i`` holds ticks ``i * ticks_per_segment`` and the next ones.
        expected_segment_bytes: reserved on disk for a segment; the largest one so far if that is
            more.
        checksum: also protect payloads by CRC-32.
    """

    def __init__(
        self,
        folder: str,
        stream: str,
        ticks_per_segment: int,
        expected_segment_bytes: int = 0,
        checksum: bool = False,
    ) -> None:
        if ticks_per_segment < 1:
            raise ValueError("ticks_per_segment must be at least 1, not %d" % ticks_per_segment)
        self.stream = check_stream_name(stream)
        self.folder = os.path.join(folder, stream)
        self.ticks_per_segment = ticks_per_segment
        self._expected_bytes = expected_segment_bytes
        self._checksum = checksum
        self._next_index = 0
        self._segment: Optional[SegmentWriter] = None
        os.makedirs(self.folder, exist_ok=True)

    def append(
        self,
        kind: int,
        tick: int,
        frame: int,
        timestamp_s: float,
        meta: Mapping[str, Any],
        payload: Buffer = b"",
    ) -> None:
        """Write one record into the segment of its tick; see :meth:`SegmentWriter.append`.

        Raises:
            ValueError: the tick does not belong to the segment that is open: an earlier one was
                not sealed, or this one is sealed already.
        """
        index = tick // self.ticks_per_segment
        if index != self._next_index:
            raise ValueError(
                "stream %s: tick %d belongs to segment %d, but segment %d is being written"
                % (self.stream, tick, index, self._next_index)
            )
        self._open().append(kind, tick, frame, timestamp_s, meta, payload)

    def seal(self, last_tick: int) -> SealedSegment:
        """Seal the segment being written; one without records becomes an empty sealed segment.

        Args:
            last_tick: the last tick that the segment covers.
        """
        first_tick = self._next_index * self.ticks_per_segment
        if not first_tick <= last_tick < first_tick + self.ticks_per_segment:
            raise ValueError(
                "stream %s: segment %d cannot end with tick %d"
                % (self.stream, self._next_index, last_tick)
            )
        sealed = self._open().seal(first_tick, last_tick)
        self._segment = None
        self._next_index += 1
        self._expected_bytes = max(self._expected_bytes, sealed.bytes)
        return sealed

    def close(self) -> None:
        """Close without sealing: what is unsealed stays behind as an open segment."""
        if self._segment is not None:
            self._segment.close()
            self._segment = None

    def __enter__(self) -> StreamWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> SegmentWriter:
        if self._segment is None:
            self._segment = SegmentWriter(
                self.folder, self.stream, self._next_index, self._expected_bytes, self._checksum
            )
        return self._segment


def write_episode_file(folder: str, header: Mapping[str, Any]) -> str:
    """Write ``episode.json`` atomically; return its path."""
    path = os.path.join(folder, EPISODE_FILE)
    partial = path + ".partial"
    with open(partial, "w", encoding="utf-8") as file:
        json.dump(header, file, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)
    _sync_folder(folder)
    return path


def reserve(fd: int, size: int) -> bool:
    """Reserve ``size`` bytes for an open file; return whether the file system really did.

    The file's length stays what was written: after a crash, reserved bytes must not look like the
    payload of a record that was cut short.

    The system call is made directly: where a file system does not have it, C libraries imitate
    ``posix_fallocate`` by writing to every block, which costs more than it saves. A file system
    that says yes and allocates nothing is left out too.
    """
    call = _FALLOCATE
    if call is None or call(fd, _FALLOC_FL_KEEP_SIZE, 0, size) != 0:
        return False
    if os.fstat(fd).st_blocks * 512 >= size:
        return True
    os.ftruncate(fd, 0)
    return False


def _find_fallocate() -> Any:
    try:
        call = ctypes.CDLL(None, use_errno=True).fallocate
    except (OSError, AttributeError):
        return None
    call.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    call.restype = ctypes.c_int
    return call


_FALLOCATE = _find_fallocate()
_FALLOC_FL_KEEP_SIZE = 1  # linux/falloc.h


def _sync_folder(folder: str) -> None:
    fd = os.open(folder or ".", os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def iter_whole_records(data: Buffer) -> Tuple[List[Tuple[int, RecordHeader]], int]:
    """Walk a segment's records from the first one; stop at the first that is not whole.

    A record is whole when its header's CRC holds and all its bytes are there.

    Args:
        data: the bytes of the whole file, header verified by the caller.

    Returns:
        ``(offset, header)`` of every whole record, and the offset at which the walk stopped.
    """
    found: List[Tuple[int, RecordHeader]] = []
    offset = HEADER_BYTES
    while offset < len(data):
        try:
            header = unpack_record_header(data, offset)
        except FormatError:
            break
        end = offset + header.record_bytes
        if end > len(data):
            break
        found.append((offset, header))
        offset = end
    return found, offset
