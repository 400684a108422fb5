"""Disparity of an episode's stereo pairs, read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.images import grey_pixels
from carstage.errors import DatasetError, StoreAccessError
from carstage.files.bounded import read_bounded
from carstage.plan.stereo import disparity_name
from carstage.storage.remote_path import DatasetPath


def read_disparity_steps(folder: DatasetPath, sensor_id: str, k: int) -> NDArray[np.uint16]:
    """``(H, W)`` 256ths of a pixel, 0 for none, of the episode in a folder.

    Raises:
        DatasetError: the file is missing or damaged.
        StoreAccessError: the object store lets nobody look.
    """
    path = folder / disparity_name(sensor_id, k)
    try:
        return np.asarray(grey_pixels(read_bounded(path), np.uint16), np.uint16)
    except StoreAccessError:  # a ValueError, too; it says nothing of the file
        raise
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}.") from error
