"""Files that have their name only when they are whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def flush_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folders(folder: Path) -> None:
    """Make a folder and those above it that are missing, and make their names durable.

    Raises:
        OSError: it cannot be made, or something else has that name.
    """
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for one in missing or [folder]:
        with suppress(PermissionError):  # one may write into a folder and not read it
            flush_folder(one.parent)


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


def write_whole(
    path: Path, content: bytes | memoryview, *, on_its_way: bool = False, durable: bool = False
) -> None:
    """Write a file that is never seen half written under its own name.

    Args:
        path: its name.
        content: all of it.
        on_its_way: let the system begin to bring it to the disk now, while others work; whoever
            makes it durable later then waits for little.
        durable: it is on the disk under its name on return.
    """
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(content)
        if on_its_way:
            file.flush()
            # Of pages that are not on the disk yet it drops none, but has them written.
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        if durable:
            file.flush()
            os.fsync(file.fileno())
    if durable:
        flush_folder(path.parent)
