"""Bytes of the raw log; they are fixed in docs/formats/raw-log.md.

Standard library only, Python 3.8, like the writer beside it: the collector uses both under
whichever interpreter has the ``carla`` wheel that fits the user's server.
"""

from __future__ import annotations

import json
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

FLAG_PAYLOAD_MAPPED = 2
"""The payload is not in the record: it stands in the segment's payload file, at its slot."""
FLAG_PAYLOAD_BLOCKS = 4
"""The payload is not in the record: it stands in the segment's file of blocks, from one on."""

WORLD = "world"
LEDGER = "ledger"
EPISODE_FILE = "episode.json"
MAP_FILE = "map.xodr"
"""The town's OpenDRIVE text, UTF-8; logs of before have none."""
SEALED_SUFFIX = ".seg"
PAYLOAD_SUFFIX = ".raw"
BLOCKS_SUFFIX = ".blk"
UNSEALED = ".open"
"""Ends the names of a segment's files until it is sealed."""
FREE = ".free"
"""Ends the names of a removed segment's files that a later one of the stream takes."""

BLOCK_BYTES = 4096

MAX_SEGMENT_INDEX = 999_999

_SEGMENT_HEADER = struct.Struct("<8sHHI32s12sI")
_RECORD_HEADER = struct.Struct("<4sHHQdIIQIIQII")
_CRC = struct.Struct("<I")
_ALIGNMENT = 8
_STREAM_NAME = re.compile(r"(?=.{1,31}\Z)[A-Za-z0-9][A-Za-z0-9_.-]*(@[1-9][0-9]?)?\Z")
_SEGMENT_FILE = re.compile(r"(\d{6})\.seg\Z")

ACTOR_RECORD = struct.Struct("<II15f")
"""One actor of a world snapshot: id, reserved, then location, rotation (pitch, yaw, roll in deg),
velocity, angular velocity (deg/s), acceleration; 3 float32 each, world frame."""

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
    sequence: int
    tick: int
    slot: int = 0

    @property
    def record_bytes(self) -> int:
        """Bytes of the whole record in the segment: header, meta, payload if here, padding."""
        elsewhere = self.flags & (FLAG_PAYLOAD_MAPPED | FLAG_PAYLOAD_BLOCKS)
        inline = 0 if elsewhere else self.payload_bytes
        return padded(HEADER_BYTES + self.meta_bytes + inline)

    @property
    def payload_place(self) -> Optional[Tuple[str, int]]:
        """Suffix of the file with the payload and its offset there; ``None``: in the record."""
        if self.flags & FLAG_PAYLOAD_MAPPED:
            return PAYLOAD_SUFFIX, self.slot * self.payload_bytes
        if self.flags & FLAG_PAYLOAD_BLOCKS:
            return BLOCKS_SUFFIX, self.slot * BLOCK_BYTES
        return None


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
        ValueError: when it is not a sensor's id, or one and the number of its agent: at most 31
            characters of ``[A-Za-z0-9][A-Za-z0-9_.-]*(@[1-9][0-9]?)?``.
    """
    if not _STREAM_NAME.match(stream):
        raise ValueError(
            "stream name %r must match [A-Za-z0-9][A-Za-z0-9_.-]*(@[1-9][0-9]?)? and have at most "
            "31 characters (it names a folder)" % (stream,)
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
        0,
        header.sequence,
        header.tick,
        header.slot,
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
        sequence=fields[9],
        tick=fields[10],
        slot=fields[11],
    )


_CANONICAL_JSON = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
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
    text = _CANONICAL_JSON.encode(meta).encode("utf-8")
    return text.ljust(padded(len(text)), b" ")


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
