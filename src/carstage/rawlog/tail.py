"""The newest whole record of a stream that is being written: what a preview shows.

Converters wait until a segment is sealed. Somebody who watches need not: a record is whole when its
header's CRC holds and all its bytes are there (``iter_whole_records``), and is never changed.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carstage.rawlog import format as raw

_LARGEST_PAYLOAD = 1 << 28


@dataclass(frozen=True, slots=True)
class NewRecord:
    """A record, copied out of its file.

    Attributes:
        tick: index from the first tick after warm-up.
        meta: the record's JSON object.
        payload: its bytes.
    """

    tick: int
    meta: dict[str, Any]
    payload: bytes


class NewestRecords:
    """Follows one stream; each look reads the headers that are new, and one payload.

    Args:
        folder: the attempt's folder.
        stream: name of the stream.
    """

    def __init__(self, folder: Path, stream: str) -> None:
        self._folder = folder / raw.check_stream_name(stream)
        self._segment = -1
        self._offset = raw.HEADER_BYTES

    def look(self) -> NewRecord | None:
        """The newest data record; None when there is none since the last look."""
        segment = self._newest_segment()
        if segment is None:
            return None
        if segment != self._segment:
            self._segment, self._offset = segment, raw.HEADER_BYTES
        for suffix in (raw.SEALED_SUFFIX, raw.SEALED_SUFFIX + raw.UNSEALED):
            path = self._folder / f"{segment:06d}{suffix}"
            try:
                with path.open("rb", buffering=0) as file:
                    return self._read(file.fileno())
            except FileNotFoundError:
                continue  # sealed, or removed, meanwhile
        return None

    def _is_there(self) -> bool:
        """Whether the segment is not removed: a later one may use its files then."""
        sealed = self._folder / f"{self._segment:06d}{raw.SEALED_SUFFIX}"
        return sealed.exists() or sealed.with_name(sealed.name + raw.UNSEALED).exists()

    def _newest_segment(self) -> int | None:
        try:
            names = os.listdir(self._folder)  # noqa: PTH208 - names alone, ten times a second
        except OSError:
            return None
        numbers = [raw.segment_index(name.removesuffix(raw.UNSEALED)) for name in names]
        return max((number for number in numbers if number is not None), default=None)

    def _read(self, file: int) -> NewRecord | None:
        size = os.fstat(file).st_size
        found: tuple[int, raw.RecordHeader] | None = None
        while True:
            try:
                header = raw.unpack_record_header(os.pread(file, raw.HEADER_BYTES, self._offset))
            except raw.FormatError:
                break
            end = self._offset + header.record_bytes
            if end > size:
                break
            if header.kind == raw.KIND_DATA and header.payload_bytes <= _LARGEST_PAYLOAD:
                found = self._offset, header
            self._offset = end
        return None if found is None else self._record(file, *found)

    def _record(self, file: int, offset: int, header: raw.RecordHeader) -> NewRecord | None:
        meta_at = offset + raw.HEADER_BYTES
        text = os.pread(file, header.meta_bytes, meta_at)
        elsewhere = header.payload_place
        payload: bytes | None
        if elsewhere is None:
            payload = os.pread(file, header.payload_bytes, meta_at + header.meta_bytes)
        else:
            payload = self._payload_elsewhere(*elsewhere, header.payload_bytes)
        if payload is None or len(payload) != header.payload_bytes or not self._is_there():
            return None
        return NewRecord(header.tick, json.loads(text) if text.strip() else {}, payload)

    def _payload_elsewhere(self, suffix: str, place: int, size: int) -> bytes | None:
        """A payload in the file beside the segment; None where that is removed meanwhile."""
        for ending in (suffix, suffix + raw.UNSEALED):
            path = self._folder / f"{self._segment:06d}{ending}"
            try:
                with path.open("rb", buffering=0) as file:
                    return os.pread(file.fileno(), size, place)
            except FileNotFoundError:
                continue
        return None
