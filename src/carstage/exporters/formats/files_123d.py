"""The Arrow files of a 123D log: one per modality, and ``sync.arrow`` that joins them by frame.

Written by Arrow alone; py123d itself is not needed. Source of the layout: py123d 0.7's writers.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgpack
import pyarrow as pa

FORMAT: Final = "0.7.0"
"""The version of py123d whose files these are."""
_NAMESPACE: Final = uuid.UUID("123D123D-123D-123D-123D-123D123D123D")
"""py123d's, so that a frame has the id that py123d would give it."""
_BATCH_ROWS: Final = 1000
_BATCH_BYTES: Final = 1 << 24

Row = Mapping[str, Any]
"""Values by column, without the modality's key."""


@dataclass(frozen=True, slots=True)
class Modality:
    """A stream of a log.

    Attributes:
        key: name of its file, such as ``camera.pcam_f0``.
        metadata: what py123d makes its metadata of.
        columns: types by column, without the key; ``timestamp_us`` is added.
    """

    key: str
    metadata: Mapping[str, Any]
    columns: Mapping[str, pa.DataType]

    @property
    def schema(self) -> pa.Schema:
        """The schema of its file."""
        columns = {"timestamp_us": pa.int64(), **self.columns}
        fields = [pa.field(f"{self.key}.{name}", kind) for name, kind in columns.items()]
        return pa.schema(fields, {b"metadata": msgpack.packb(dict(self.metadata))})


class ModalityFile:
    """The file of a modality, open for rows.

    Args:
        folder: of the log.
        modality: what the file is of.
    """

    def __init__(self, folder: Path, modality: Modality) -> None:
        self._modality = modality
        self._schema = modality.schema
        self._sink = pa.OSFile(str(folder / f"{modality.key}.arrow"), "wb")
        self._writer = pa.ipc.new_file(self._sink, self._schema)
        self._rows: list[dict[str, Any]] = []
        self._bytes = 0
        self.count = 0

    def add(self, time_us: int, row: Row) -> int:
        """Append a row; its index."""
        values = {"timestamp_us": time_us, **row}
        self._rows.append({f"{self._modality.key}.{name}": v for name, v in values.items()})
        self._bytes += sum(len(value) for value in row.values() if isinstance(value, bytes))
        self.count += 1
        if len(self._rows) >= _BATCH_ROWS or self._bytes >= _BATCH_BYTES:
            self._flush()
        return self.count - 1

    def close(self) -> None:
        """Write what is left, and the end of the file; closing twice is fine."""
        if not self._sink.closed:
            self._flush()
            self._writer.close()
            self._sink.close()

    def _flush(self) -> None:
        if self._rows:
            self._writer.write_batch(pa.RecordBatch.from_pylist(self._rows, schema=self._schema))
        self._rows, self._bytes = [], 0


class LogFiles:
    """The files of one log.

    Args:
        folder: of the log; it exists.
        log: what py123d makes its ``LogMetadata`` of.
        modalities: what the log may hold; there is a file for each that has a row.
    """

    def __init__(self, folder: Path, log: Mapping[str, Any], modalities: Sequence[Modality]):
        self._folder = folder
        self._log = log
        self._modalities = {modality.key: modality for modality in modalities}
        self._files: dict[str, ModalityFile] = {}
        self._frames: list[dict[str, Any]] = []

    def add(self, time_us: int, rows: Mapping[str, Row]) -> None:
        """Append a frame.

        Args:
            time_us: microseconds since the first frame.
            rows: by key of a modality; others have no data of this frame.
        """
        frame: dict[str, Any] = {}
        for key, row in rows.items():
            if key not in self._files:
                self._files[key] = ModalityFile(self._folder, self._modalities[key])
            frame[key] = self._files[key].add(time_us, row)
        name = f"{self._log['split']}:{self._log['log_name']}:{time_us}"
        frame["sync.uuid"] = uuid.uuid5(_NAMESPACE, name).bytes
        frame["sync.timestamp_us"] = time_us
        self._frames.append(frame)

    def finish(self) -> None:
        """Close all files, and write which rows belong to a frame."""
        self.close()
        fields = [pa.field("sync.uuid", pa.uuid()), pa.field("sync.timestamp_us", pa.int64())]
        fields += [pa.field(key, pa.int64()) for key in self._modalities if key in self._files]
        schema = pa.schema(fields, {b"metadata": msgpack.packb(dict(self._log))})
        columns = {
            field.name: pa.array([frame.get(field.name) for frame in self._frames], field.type)
            for field in schema
        }
        path = str(self._folder / "sync.arrow")
        with pa.OSFile(path, "wb") as sink, pa.ipc.new_file(sink, schema) as writer:
            writer.write_batch(pa.record_batch(columns, schema=schema))

    def close(self) -> None:
        """Close what is open; closing twice is fine."""
        for file in self._files.values():
            file.close()


DATASET: Final = "carstage"
"""The dataset's name in 123D, the first word of its splits."""


def log_metadata(
    split: str, log_name: str, location: str, town: Mapping[str, Any] | None
) -> dict[str, Any]:
    """What ``sync.arrow`` says of its log, and of its map where there is one."""
    return {
        "dataset": DATASET,
        "split": split,
        "log_name": log_name,
        "location": location,
        "version": FORMAT,
        "map_metadata": None if town is None else dict(town),
    }
