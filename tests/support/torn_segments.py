"""Segments whose writer was killed: what a scan finds whole in them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from carstage.rawlog import format as raw


class WholeRecord(NamedTuple):
    """A record before the torn tail."""

    tick: int
    sequence: int
    meta: dict[str, Any]
    payload: bytes


class TornSegment(NamedTuple):
    """The stream, the number and the whole records, and where they end in the file."""

    stream: str
    index: int
    records: list[WholeRecord]
    whole_bytes: int


def read_torn(path: Path) -> TornSegment:
    """Scan a segment that was never sealed.

    Raises:
        FormatError: not even its header is whole.
    """
    data = path.read_bytes()
    head = raw.unpack_segment_header(data)
    whole, end = raw.iter_whole_records(data)
    records = [
        _record(path, data, offset, header)
        for offset, header in whole
        if header.kind != raw.KIND_SEAL
    ]
    return TornSegment(head.stream, head.segment, records, end)


def _record(path: Path, data: bytes, offset: int, header: raw.RecordHeader) -> WholeRecord:
    meta_at = offset + raw.HEADER_BYTES
    begin = meta_at + header.meta_bytes
    meta = json.loads(data[meta_at:begin]) if header.meta_bytes else {}
    if header.payload_place is not None:
        suffix, begin = header.payload_place
        data = path.with_name(path.name.replace(raw.SEALED_SUFFIX, suffix)).read_bytes()
    payload = data[begin : begin + header.payload_bytes]
    assert len(payload) == header.payload_bytes
    return WholeRecord(header.tick, header.sequence, meta, payload)
