"""Paths that users write with a tilde."""

from __future__ import annotations

from pathlib import Path


def without_tilde(path: str | Path) -> Path:
    """A path with its leading ``~`` or ``~user`` replaced; as it is where there is no such user."""
    path = Path(path)
    try:
        return path.expanduser()
    except RuntimeError:
        return path
