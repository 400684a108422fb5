"""A dataset and its episodes, read lazily from their files."""

from __future__ import annotations

from pathlib import Path


class Episode:
    """One committed episode."""


class Dataset:
    """A dataset in a folder.

    Args:
        path: the folder that was given as ``--out``.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @property
    def episodes(self) -> tuple[Episode, ...]:
        """The committed episodes, sorted by id."""
        raise NotImplementedError
