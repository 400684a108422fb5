"""Exports as a whole: listed, given another name, removed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.exporters.target import DOCUMENT
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.storage.disk import disk_error
from carstage.storage.remote_files import remote_files
from carstage.storage.remote_path import DatasetPath, RemotePath


def read_export(place: DatasetPath) -> Mapping[str, Any] | None:
    """What ``export.json`` says; None: there is no whole export."""
    try:
        document = json.loads(read_bounded(place / DOCUMENT, LARGEST_DOCUMENT_BYTES))
    except (OSError, ValueError):
        return None
    return document if isinstance(document, dict) else None


def is_export(place: DatasetPath) -> bool:
    """Whether there is an export."""
    return (place / DOCUMENT).is_file()


def size_of_export(place: DatasetPath) -> int:
    """What the files of an export take, bytes."""
    if isinstance(place, RemotePath):
        return sum(one.bytes for one in remote_files(place.root).below(place.key))
    return sum(path.lstat().st_size for path in place.rglob("*") if path.is_file())


def remove_export(place: DatasetPath) -> None:
    """Remove an export; first what makes it one.

    Raises:
        BadInputError: there is none.
        StorageError: something cannot be removed.
    """
    if not is_export(place):
        raise BadInputError(
            f"{place} was not written by `carstage export`: it has no {DOCUMENT}.",
            "Name the folder of an export, or remove it yourself.",
        )
    if isinstance(place, RemotePath):
        files = remote_files(place.root)
        files.delete([(place / DOCUMENT).key])
        files.delete([one.key for one in files.below(place.key)])
        return
    if place.is_symlink():
        raise BadInputError(f"{place} is a link.", "Name the folder that it leads to.")
    try:
        (place / DOCUMENT).unlink()
        shutil.rmtree(place)
    except OSError as error:
        raise disk_error(error, str(place)) from error


def move_export(place: Path, target: Path) -> None:
    """Give the folder of an export another name.

    Raises:
        BadInputError: there is no export, or something has that name.
        StorageError: it cannot be moved.
    """
    if not is_export(place):
        raise BadInputError(f"{place} is no export.", "Name the folder of an export.")
    if target.exists():
        raise BadInputError(f"{target} exists already.", "Choose another name.")
    try:
        place.rename(target)
    except OSError as error:
        raise disk_error(error, str(target)) from error
