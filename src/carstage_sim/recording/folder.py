"""Where logs lie, and which names a client may give them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from carstage_sim.cache import cache_folder
from carstage_sim.recording.errors import RecordingError
from carstage_sim.recording.layout import MAGIC

_DRIVE = re.compile(r"^[A-Za-z]:")


def default_recordings() -> Path:
    """``recordings`` in the cache folder."""
    return cache_folder() / "recordings"


@dataclass(frozen=True, slots=True)
class RecordingsFolder:
    """The one place of the server's logs (CARLA's ``CarlaUE4/Saved``).

    A client says where to write, and much of what it writes. So nothing lies outside.

    Attributes:
        path: of the folder; default: ``recordings`` in the cache folder.
        absolute: whether absolute paths of clients stand for places below the folder, such as
            ``/data/a.log`` for ``PATH/data/a.log``. Else they are refused.
    """

    path: Path = field(default_factory=default_recordings)
    absolute: bool = True

    def log(self, name: str) -> Path:
        """The file that a client means.

        CARLA takes any name with a slash as a path of its own. Here the answer tells the place.

        Raises:
            RecordingError: no name, or one that leads out of the folder.
        """
        if not name.strip() or "\0" in name:
            raise RecordingError(f"{name!r} is not a file name")
        if "\\" in name or _DRIVE.match(name):
            raise RecordingError(
                f"{name!r} is a path of another system; name a file, or a POSIX path"
            )
        folder, path = self.path.resolve(), Path(name)
        if path.is_absolute() and not path.is_relative_to(folder):
            if not self.absolute:
                raise RecordingError(
                    f"{name!r} is an absolute path, which this server refuses; name a file, which "
                    f"lies in its folder {folder}"
                )
            path = path.relative_to("/")
        path = (folder / path).resolve()  # of links, too
        if path == folder or not path.is_relative_to(folder):
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
