"""Datasets as a whole: given another name, removed."""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path

from carstage.errors import BadInputError, DatasetError
from carstage.files.whole import write_whole
from carstage.storage.description import read_description
from carstage.storage.disk import disk_error
from carstage.storage.object_cache import forget_copies
from carstage.storage.remote_files import remote_files
from carstage.storage.remote_path import DatasetPath, RemotePath

MOST_LETTERS = 100
_FIRST = "commits"
"""Without its markers no episode is in the dataset any more: nobody reads half of one."""
_PARTS = ("leases", "lost", "episodes", "maps", "runs")
_FILES = ("splits.json", "catalog.sqlite", "catalog.sqlite-wal", "catalog.sqlite-shm")
_REPORT = "report.html"
_LAST = "dataset.json"
"""What is broken off can be given again while it is there."""


def check_label(name: str) -> str:
    """A name that a run or a dataset may be shown by, without spaces around it.

    Raises:
        BadInputError: it is empty, too long, or holds what cannot be printed.
    """
    name = name.strip()
    if not name or len(name) > MOST_LETTERS or not name.isprintable():
        raise BadInputError(
            f"{name[:MOST_LETTERS]!r} cannot be a name.",
            f"Use 1 to {MOST_LETTERS} letters that can be printed.",
        )
    return name


def rename_dataset(place: DatasetPath, name: str) -> None:
    """Give a dataset another name in its ``dataset.json``; its folder stays where it is.

    Raises:
        BadInputError: the name cannot be used.
        DatasetError: there is no dataset, or one of another version.
        StorageError: it cannot be written.
    """
    path = place / _LAST
    document = {**read_description(path), "name": check_label(name)}
    content = (json.dumps(document, indent=1) + "\n").encode()
    if isinstance(path, RemotePath):
        path.write_bytes(content)
        return
    try:
        write_whole(path, content, durable=True)
    except OSError as error:
        raise disk_error(error, str(path)) from error


def check_removable(place: DatasetPath) -> None:
    """Refuse to remove what is no dataset.

    Raises:
        DatasetError: it has neither ``dataset.json`` nor commit markers.
        BadInputError: it is a link to one.
    """
    if not (place / _LAST).is_file() and not (place / _FIRST).is_dir():
        raise DatasetError(
            f"{place} is no Car-STAGE dataset: it has no {_LAST}.", "Name what was given as --out."
        )
    if isinstance(place, Path) and place.is_symlink():
        raise BadInputError(f"{place} is a link.", "Name the folder that it leads to.")


def remove_dataset(place: DatasetPath) -> list[str]:
    """Remove a dataset with its runs; what else lies in its folder stays.

    The markers of its episodes go first. Whoever calls has seen that nobody writes into it.

    Returns:
        Names of what stays in the folder; empty: it is gone.

    Raises:
        DatasetError: there is none.
        BadInputError: the place is a link to one.
        StorageError: something cannot be removed; the same call again goes on.
    """
    check_removable(place)
    if isinstance(place, RemotePath):
        return _remove_remote(place)
    try:
        for name in (_FIRST, *_PARTS, *_FILES, _REPORT, _LAST):
            _remove(place / name)
        left = sorted(path.name for path in place.iterdir())
        if not left:
            place.rmdir()
    except OSError as error:
        raise disk_error(error, str(place)) from error
    return left


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _remove_remote(place: RemotePath) -> list[str]:
    files = remote_files(place.root)
    prefix = f"{place.key}/" if place.key else ""
    keys = [one.key for one in files.below(place.key)]
    parts = {key: key[len(prefix) :].split("/")[0] for key in keys}
    for names in ((_FIRST,), (*_PARTS, *_FILES, _REPORT), (_LAST,)):
        with suppress(FileNotFoundError):
            files.delete([key for key in keys if parts[key] in names])
    forget_copies(str(place))
    return sorted(set(parts.values()) - {_FIRST, *_PARTS, *_FILES, _REPORT, _LAST})
