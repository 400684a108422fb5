"""What the pool's processes give back, and where they leave parts for a while.

It loads nothing that only they need: the process that hands out work knows it, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carstage.storage.marker import FileEntry

LABEL_PARTS = ".labels"
"""Folder of the label parts below the raw log; its name can be no stream's."""


@dataclass(frozen=True, slots=True)
class EncodedSegment:
    """What became of one sensor's segment.

    Attributes:
        rows: of a sensor that becomes a table.
        files: of a sensor that becomes files; hashed as they were written, so that nobody has to
            read them for it.
    """

    rows: tuple[dict[str, Any], ...] = ()
    files: tuple[FileEntry, ...] = ()


def parts_folder(raw_folder: Path, agent: str | None) -> Path:
    """Where parts of label tables are kept for a while: the ego's, or those of an agent."""
    return raw_folder / (LABEL_PARTS if agent is None else f"{LABEL_PARTS}.{agent}")
