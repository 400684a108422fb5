"""Bird's-eye grids and voxels of an episode, read."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from carstage.birds_eye import BirdsEye, birds_eye_name, unpack_birds_eye
from carstage.errors import DatasetError, StoreAccessError
from carstage.files.bounded import read_bounded
from carstage.occupancy import Occupancy, occupancy_name, unpack_occupancy
from carstage.storage.remote_path import DatasetPath

_Content = TypeVar("_Content")


def read_birds_eye(folder: DatasetPath, k: int) -> BirdsEye:
    """The grids of frame ``k`` of the episode in a folder.

    Raises:
        DatasetError: the file is missing or damaged.
        StoreAccessError: the object store lets nobody look.
    """
    return _read(folder / birds_eye_name(k), unpack_birds_eye)


def read_occupancy(folder: DatasetPath, k: int) -> Occupancy:
    """The voxels of frame ``k`` of the episode in a folder; raises the same."""
    return _read(folder / occupancy_name(k), unpack_occupancy)


def _read(path: DatasetPath, unpack: Callable[[bytes], _Content]) -> _Content:
    try:
        return unpack(read_bounded(path))
    except StoreAccessError:  # a ValueError, too; it says nothing of the file
        raise
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}.") from error
