"""Where everything is kept that can be computed again, also where there is no home."""

from __future__ import annotations

import logging
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "CARSTAGE_CACHE_DIR"
"""Environment variable that moves every cache of Car-STAGE to another folder."""

logger = logging.getLogger(__name__)


def cache_folder() -> Path:
    """The folder of all caches: the user's, or the one that ``CARSTAGE_CACHE_DIR`` names.

    Where the user's cannot be written (containers, no ``HOME``), a private temporary one takes its
    place, for the processes that this one starts, too.
    """
    override = os.environ.get(CACHE_VARIABLE)
    if override:
        return Path(override)
    usual = platformdirs.user_cache_path("carstage", appauthor=False)
    if is_usable(usual):
        return usual
    folder = private_folder() / "cache"
    logger.warning(
        "The cache folder %s cannot be written; %s is used. Set %s to keep what is computed.",
        usual,
        folder,
        CACHE_VARIABLE,
    )
    os.environ[CACHE_VARIABLE] = str(folder)
    return folder


def keep_in_cache(path: Path, content: str | bytes) -> None:
    """Write a file of a cache, which others may write, too; one that cannot be written is no fault.

    Args:
        path: its name; it is never seen half written.
        content: all of it; text becomes UTF-8.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, partial = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
        Path(partial).replace(path)
    except OSError:
        return


def home_folder() -> Path:
    """The user's home, or a private temporary folder where there is none that can be written."""
    home = os.environ.get("HOME", "")
    return Path(home) if home and is_usable(Path(home)) else private_folder()


@cache
def is_usable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if it is missing."""
    if not folder.is_absolute():
        return False  # of a user without a home
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@cache
def private_folder() -> Path:
    """A temporary folder that this user alone can use: the same one every time, where possible."""
    folder = Path(tempfile.gettempdir()) / f"carstage-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    private = stat.S_ISDIR(found.st_mode) and not stat.S_IMODE(found.st_mode) & 0o077
    if private and found.st_uid == os.getuid():
        return folder
    return Path(tempfile.mkdtemp(prefix="carstage-"))  # somebody else took the name
