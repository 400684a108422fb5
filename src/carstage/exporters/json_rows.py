"""JSON arrays that are written row by row, so that tables need not fit into memory."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any


class JsonRows:
    """A file with a JSON array, a row per line.

    Args:
        path: the file; it is a whole array after ``close``.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("w", encoding="utf-8")
        self._file.write("[")
        self.count = 0

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row."""
        self.add_value(row)

    def add_value(self, value: object) -> None:
        """Append what JSON can hold."""
        self._file.write((",\n" if self.count else "\n") + json.dumps(value))
        self.count += 1

    def close(self) -> None:
        """End the array; a second call does nothing."""
        if not self._file.closed:
            self._file.write("\n]\n")
            self._file.close()

    def move_into(self, file: IO[str]) -> None:
        """Copy the array into another file and remove this one."""
        self.close()
        with self.path.open(encoding="utf-8") as rows:
            shutil.copyfileobj(rows, file)
        self.path.unlink()
