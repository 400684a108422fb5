"""OpenDRIVE files of the user that a configuration offers to the embedded simulator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from carstage.config.dimensions import Path as Place
from carstage.config.dimensions import located_maps
from carstage.config.explain import error_of
from carstage.config.fields import shortened
from carstage.config.model import Config
from carstage.config.scene import MAP_SUFFIX, map_name
from carstage.config.servers import EmbeddedServerConfig
from carstage.files.bounded import read_bounded
from carstage.files.hashing import hash_of
from carstage.files.home import without_tilde

_LARGEST_BYTES = 64 << 20
"""The most that the simulator takes of a client, too."""


@dataclass(frozen=True, slots=True)
class OwnMap:
    """An OpenDRIVE file.

    Attributes:
        field: path of the setting that names it.
        path: the file, absolute.
        opendrive: named hash of its text, as ``episode.json`` names a town's.
    """

    field: Place
    path: Path
    opendrive: str


def map_sources(config: Config, folder: Path | None = None) -> list[tuple[Place, Path]]:
    """The files and folders that are offered as maps, absolute, each behind its setting's path.

    Those of ``server.maps`` and the files that ``map`` names; none for another server.

    Args:
        config: the configuration.
        folder: what relative paths are relative to; None: the working directory.
    """
    folder = folder or Path.cwd()
    if not isinstance(config.server, EmbeddedServerConfig):
        return []
    given: list[tuple[Place, str]] = [
        (("server", "maps", i), text) for i, text in enumerate(config.server.maps)
    ]
    given += [(field, name) for field, name in located_maps(config) if name.endswith(MAP_SUFFIX)]
    return [(field, folder / without_tilde(text)) for field, text in given]


def own_maps(config: Config, folder: Path | None = None) -> dict[str, OwnMap]:
    """The user's maps by name.

    Args:
        config: the configuration.
        folder: what relative paths are relative to; None: the working directory.

    Raises:
        ConfigError: a file or folder is missing, is no OpenDRIVE, or two of one name differ.
    """
    found: dict[str, OwnMap] = {}
    for field, source in map_sources(config, folder):
        for path in _files(field, source):
            one = OwnMap(field, path, hash_of(_text(field, path).encode("utf-8")))
            other = found.setdefault(map_name(path.name), one)
            if other.opendrive != one.opendrive:
                message = f"{path} and {other.path} differ and have one name."
                raise error_of([(field, message, "Rename one.")])
    return found


def _files(field: Place, source: Path) -> Iterator[Path]:
    if source.is_dir():
        files = sorted(source.glob(f"*{MAP_SUFFIX}"))
        if not files:
            message = f"{source} holds no {MAP_SUFFIX} file."
            raise error_of([(field, message, "Name another folder.")])
        yield from files
    elif source.suffix != MAP_SUFFIX:
        message = f"{shortened(str(source))} is neither a folder nor a {MAP_SUFFIX} file."
        hint = "Name an OpenDRIVE file, or a folder of them; built-in towns need no entry."
        raise error_of([(field, message, hint)])
    else:
        yield source


def _text(field: Place, path: Path) -> str:
    """The text as the simulator reads it and the client gets it: lines end in a line feed."""
    try:
        text = read_bounded(path, _LARGEST_BYTES).decode("utf-8")
        return text.replace("\r\n", "\n").replace("\r", "\n")
    except OSError as error:
        reason = error.strerror
    except UnicodeDecodeError:
        reason = "it is not UTF-8 text"
    except ValueError as error:
        reason = str(error)
    raise error_of([(field, f"{path} cannot be read: {reason}.", "Name an OpenDRIVE file.")])
