"""Where logs lie, and which names a client may give them."""

from __future__ import annotations

import re
from pathlib import Path

from carstage_sim.cache import cache_folder
from carstage_sim.recording.errors import RecordingError
from carstage_sim.recording.layout import MAGIC

_DRIVE = re.compile(r"^[A-Za-z]:")


def recordings_folder() -> Path:
    """The folder of this server for names without a path (CARLA's ``CarlaUE4/Saved``)."""
    return cache_folder() / "recordings"


def log_path(name: str, folder: Path) -> Path:
    """The file that a client means.

    CARLA takes any name with a slash as a path of its own. Here absolute paths are taken as they
    are, and everything else lies below ``folder``.

    Raises:
        RecordingError: no name, or one that leads out of the folder.
    """
    if not name.strip() or "\0" in name:
        raise RecordingError(f"{name!r} is not a file name")
    if Path(name).is_absolute():
        return Path(name)
    if "\\" in name or _DRIVE.match(name):
        raise RecordingError(f"{name!r} is a path of another system; name a file, or a POSIX path")
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise RecordingError(f"{name!r} leads out of the server's folder {folder}")
    return path


def check_writable(path: Path) -> None:
    """Let nothing but logs be overwritten.

    Raises:
        RecordingError: another kind of file has this name, or the folder cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not _may_be_overwritten(path):
            raise RecordingError(f"{path} exists and is not a CARLA recorder: not overwritten")
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from error


def _may_be_overwritten(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(4 + len(MAGIC))
    return not head or head[4:] == MAGIC.encode()
