"""Files that have their name only when they are whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a hidden file beside ``path`` to write; it takes that name if the block succeeds.

    What fails leaves nothing behind, and what stood under the name stays.
    """
    temporary = path.with_name(f".{path.name}")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that is never seen half written under its own name."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)
