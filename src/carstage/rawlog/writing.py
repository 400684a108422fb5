"""Writes the raw log: segments, streams, ``episode.json``.

Standard library only, Python 3.8. All stores write the same segments: ``chunklog`` keeps payloads
in the records, ``mmap`` (the paper's) in a memory-mapped file per segment beside them, and
``blocks`` in a file beside them that a later segment uses again.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from typing import Any, List, Mapping, Optional, Sequence, Union

from carstage.rawlog.format import (
    BLOCKS_SUFFIX,
    EPISODE_FILE,
    FLAG_PAYLOAD_BLOCKS,
    FLAG_PAYLOAD_MAPPED,
    HEADER_BYTES,
    KIND_SEAL,
    MAP_FILE,
    MAX_SEGMENT_INDEX,
    PAYLOAD_SUFFIX,
    SEALED_SUFFIX,
    UNSEALED,
    Buffer,
    RecordHeader,
    SealedSegment,
    check_stream_name,
    encode_meta,
    pack_record_header,
    pack_segment_header,
)
from carstage.rawlog.payloads import BlockPayloads, MappedPayloads, open_free, reserve

CHUNKLOG = "chunklog"
MMAP = "mmap"
BLOCKS = "blocks"
RAW_STORES = (CHUNKLOG, MMAP, BLOCKS)
_PAYLOAD_FILES = {
    MMAP: (PAYLOAD_SUFFIX, FLAG_PAYLOAD_MAPPED),
    BLOCKS: (BLOCKS_SUFFIX, FLAG_PAYLOAD_BLOCKS),
}


MOST_WAITING = 256
"""Parts of records that are written at once; the kernel takes up to 1024."""


class SegmentWriter:
    """Writes one segment: header, records, seal; a context manager that leaves what is unsealed.

    An unsealed segment stays behind as ``NNNNNN.seg.open``, with every record that the kernel was
    given; that is what a crash leaves too.

    Args:
        folder: the stream's folder; it must exist.
        stream: the stream's name.
        index: the segment's number.
        expected_bytes: reserve that much on disk, when the file system can; 0 reserves nothing.
        store: where payloads go.
        slots: store ``mmap``: the payload file has room for so many of the first one's size, and
            what does not fit goes into its record.

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
        store: str = CHUNKLOG,
        slots: int = 0,
        durable: bool = True,
    ) -> None:
        if not 0 <= index <= MAX_SEGMENT_INDEX:
            raise ValueError("segment index %d is outside 0...%d" % (index, MAX_SEGMENT_INDEX))
        self.stream = stream
        self.index = index
        self.path = os.path.join(folder, "%06d%s" % (index, SEALED_SUFFIX))
        self.open_path = self.path + UNSEALED
        suffix, self._payload_flag = _PAYLOAD_FILES.get(store, ("", 0))
        self._payload_path = os.path.join(folder, "%06d%s" % (index, suffix))
        if os.path.exists(self.path):
            raise FileExistsError(errno.EEXIST, "segment is sealed already", self.path)
        header = pack_segment_header(stream, index)
        self._folder = folder
        self._store = store
        self._slots = slots
        self._expected_bytes = expected_bytes
        self._durable = durable
        self._payloads: Union[MappedPayloads, BlockPayloads, None] = None
        self._sequence = 0
        self._size = 0
        self._waiting: List[Buffer] = []
        if store == BLOCKS:
            self._fd, used = open_free(self.open_path)
        else:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            self._fd, used = os.open(self.open_path, flags, 0o644), False
        try:
            if used:
                os.ftruncate(self._fd, 0)
            inline = store == CHUNKLOG and expected_bytes > 0
            self._reserved = reserve(self._fd, expected_bytes) if inline else False
            self._write([header])
        except BaseException:
            self.close()
            raise

    @property
    def size(self) -> int:
        """Bytes written so far, header included."""
        return self._size + sum(map(len, self._waiting))

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
        waits: bool = False,
    ) -> None:
        """Write one record, after its payload if that has a file of its own.

        Args:
            kind: ``KIND_DATA`` or ``KIND_TABLE``.
            tick: index from the first tick after warm-up.
            frame: the server's frame number.
            timestamp_s: the server's simulated time, s.
            meta: JSON object.
            payload: any contiguous buffer; it must stay as it is until it is written.
            waits: it may be written with a later record, in one system call, or by :meth:`flush`.

        Raises:
            OSError: whatever the file system says; the record then is a torn tail.
        """
        view = memoryview(payload).cast("B") if len(payload) else memoryview(b"")
        meta_bytes = encode_meta(meta)
        slot = self._put(view)
        header = RecordHeader(
            kind=kind,
            frame=frame,
            timestamp_s=timestamp_s,
            meta_bytes=len(meta_bytes),
            flags=0 if slot is None else self._payload_flag,
            payload_bytes=view.nbytes,
            sequence=self._sequence,
            tick=tick,
            slot=slot or 0,
        )
        inline = view if slot is None else memoryview(b"")
        padding = header.record_bytes - HEADER_BYTES - header.meta_bytes - inline.nbytes
        self._waiting += (pack_record_header(header), meta_bytes, inline, b"\0" * padding)
        self._sequence += 1
        if not waits or len(self._waiting) > MOST_WAITING:
            self.flush()

    def flush(self) -> None:
        """Write the records that wait.

        Raises:
            OSError: as for :meth:`append`.
        """
        if self._waiting:
            parts, self._waiting = self._waiting, []
            self._write(parts)

    def _put(self, payload: memoryview) -> Optional[int]:
        """Put a payload into the payload file; its slot, or ``None`` where it does not go there."""
        if self._store == CHUNKLOG or not payload.nbytes:
            return None
        if self._payloads is None:
            path = self._payload_path + UNSEALED
            if self._store == MMAP:
                self._payloads = MappedPayloads(path, self._slots, payload.nbytes)
            else:
                self._payloads = BlockPayloads(path, self._expected_bytes)
        return self._payloads.put(payload)

    def seal(self, first_tick: int, last_tick: int) -> SealedSegment:
        """Append the seal record, bring all to the disk, give the file its final name."""
        self.flush()
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
        if self._payloads is not None:
            self._payloads.finish(self._durable)
            os.rename(self._payloads.path, self._payload_path)
        if self._reserved:
            os.ftruncate(self._fd, self._size)
        if self._durable:
            os.fsync(self._fd)
        self.close()
        # The records last: a sealed segment has its payloads.
        os.rename(self.open_path, self.path)
        if self._durable:
            _sync_folder(self._folder)
        return sealed

    def close(self) -> None:
        """Close the files without sealing them; closing twice is fine."""
        if self._payloads is not None:
            self._payloads.close()
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def __enter__(self) -> SegmentWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self, parts: Sequence[Buffer]) -> None:
        written = os.pwritev(self._fd, parts, self._size)
        self._size += written
        if written == sum(map(len, parts)):
            return
        # A signal or a nearly full disk may cut a write short: go on where it stopped.
        buffers = [memoryview(part) for part in parts if len(part)]
        while True:
            while buffers and written >= buffers[0].nbytes:
                written -= buffers.pop(0).nbytes
            if not buffers:
                return
            buffers[0] = buffers[0][written:]
            written = os.pwritev(self._fd, buffers, self._size)
            self._size += written


class StreamWriter:
    """Writes one stream of an attempt as a row of segments.

    Not thread-safe: one thread writes a stream.

    Args:
        folder: the attempt's folder; the stream's folder is made below it.
        stream: the stream's name.
        ticks_per_segment: segment ``i`` holds ticks ``i * ticks_per_segment`` and the next ones.
        expected_segment_bytes: reserved on disk for a segment; the largest one so far if that is
            more.
        store: ``chunklog``; ``mmap`` for streams whose payloads have one size; or ``blocks`` for
            streams of large ones whose segments are removed as they are read.
        durable: what is sealed outlives a crash of the machine, not of the process alone.
    """

    def __init__(
        self,
        folder: str,
        stream: str,
        ticks_per_segment: int,
        expected_segment_bytes: int = 0,
        store: str = CHUNKLOG,
        durable: bool = True,
    ) -> None:
        if store not in RAW_STORES:
            raise ValueError("store must be one of %s, not %r" % (", ".join(RAW_STORES), store))
        if ticks_per_segment < 1:
            raise ValueError("ticks_per_segment must be at least 1, not %d" % ticks_per_segment)
        self.stream = check_stream_name(stream)
        self.folder = os.path.join(folder, stream)
        self.ticks_per_segment = ticks_per_segment
        self._expected_bytes = expected_segment_bytes
        self._store = store
        self._durable = durable
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
        waits: bool = False,
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
        self._open().append(kind, tick, frame, timestamp_s, meta, payload, waits)

    def flush(self) -> None:
        """Write the records that wait."""
        if self._segment is not None:
            self._segment.flush()

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
                self.folder,
                self.stream,
                self._next_index,
                self._expected_bytes,
                self._store,
                self.ticks_per_segment,
                self._durable,
            )
        return self._segment


def write_episode_file(folder: str, header: Mapping[str, Any]) -> str:
    """Write ``episode.json`` atomically; return its path."""
    text = json.dumps(header, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return _write_whole(folder, EPISODE_FILE, text + "\n")


def write_map_file(folder: str, opendrive: str) -> int:
    """Write the town's OpenDRIVE text atomically; return the CRC-32 of its bytes."""
    _write_whole(folder, MAP_FILE, opendrive)
    return zlib.crc32(opendrive.encode("utf-8"))


def _write_whole(folder: str, name: str, text: str) -> str:
    path = os.path.join(folder, name)
    partial = path + ".partial"
    # Lines end as they are: the text of a map is known by its hash.
    with open(partial, "w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)
    _sync_folder(folder)
    return path


def _sync_folder(folder: str) -> None:
    fd = os.open(folder or ".", os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
