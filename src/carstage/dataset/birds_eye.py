"""Bird's-eye grids of an episode, read."""

from __future__ import annotations

from carstage.birds_eye import BirdsEye, birds_eye_name, unpack_birds_eye
from carstage.errors import DatasetError
from carstage.files.bounded import read_bounded
from carstage.storage.remote_path import DatasetPath


def read_birds_eye(folder: DatasetPath, k: int) -> BirdsEye:
    """The grids of frame ``k`` of the episode in a folder.

    Raises:
        DatasetError: the file is missing or damaged.
    """
    path = folder / birds_eye_name(k)
    try:
        return unpack_birds_eye(read_bounded(path))
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}.") from error
