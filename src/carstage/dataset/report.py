"""``report.html``: what is in a dataset, to be looked at."""

from __future__ import annotations

from pathlib import Path


def write_report(path: str | Path, out: Path | None = None) -> Path:
    """Write one self-contained HTML page about a dataset.

    Args:
        path: folder of the dataset.
        out: the file to write; default: ``report.html`` in the dataset's folder.

    Returns:
        The file written.
    """
    raise NotImplementedError
