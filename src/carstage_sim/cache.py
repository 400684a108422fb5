"""Where everything is kept that can be computed again: machine code, trees, baked towns.

What is kept is marked when it is used, and goes when nobody used it for a month: every change of
the code that makes it gives it another name.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from platformdirs import user_cache_path

logger = logging.getLogger(__name__)

CACHE_VARIABLE = "CARSTAGE_CACHE_DIR"
"""Environment variable that moves every cache of Car-STAGE to another folder."""

DRAFTS = "*.part"
"""Names of files that are not whole yet, or never will be."""

DAY_S = 86_400.0
UNUSED_S = 30.0 * DAY_S
_AGEING = ("kernels", "meshes", "trees")


def cache_folder() -> Path:
    """The user's cache folder, or the one that ``CARSTAGE_CACHE_DIR`` names.

    Where the user's cannot be written, a new temporary one takes its place, for bakes, too. It goes
    with this process.
    """
    override = os.environ.get(CACHE_VARIABLE)
    if override:
        return Path(override)
    usual = user_cache_path("carstage", appauthor=False)
    if usual.is_absolute() and _can_be_made(usual):
        return usual
    folder = Path(tempfile.mkdtemp(prefix="carstage-cache-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[CACHE_VARIABLE] = str(folder)
    logger.warning(
        "the cache folder %s cannot be written; set %s, or all is computed anew each time",
        usual,
        CACHE_VARIABLE,
    )
    return folder


def _can_be_made(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK | os.X_OK)


@contextlib.contextmanager
def written_atomically(path: Path) -> Iterator[BinaryIO]:
    """A file to write that gets its name when it is whole: readers see all of it or nothing.

    Args:
        path: the name; its folder is made if missing.

    Raises:
        OSError: it cannot be written; nothing is left of it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not by tempfile, whose files are for their owner alone: a cache may be shared.
    draft = path.with_name(f"{path.name}.{secrets.token_hex(8)}.part")
    try:
        with draft.open("xb") as file:
            yield file
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def mark_used(path: Path) -> None:
    """Note that a file or folder of the cache is in use, to the day."""
    # A shared cache may be read-only: then its order of use stays unknown.
    with contextlib.suppress(OSError):
        if time.time() - path.stat().st_mtime > DAY_S:
            os.utime(path)


def remove_unused(folder: Path, pattern: str = "*", *, unused_s: float = UNUSED_S) -> None:
    """Remove the files and folders of a name pattern that were not used for so long."""
    before_s = time.time() - unused_s
    for path in folder.glob(pattern):
        with contextlib.suppress(OSError):  # another server removes too, or it is not ours
            if path.stat().st_mtime > before_s:
                continue
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()


def prune() -> None:
    """Remove what nobody used for long of all that is kept for every map."""
    for name in _AGEING:
        remove_unused(cache_folder() / name)
        remove_unused(cache_folder() / name, DRAFTS, unused_s=DAY_S)
