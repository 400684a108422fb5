"""Where an attempt's files go."""

from __future__ import annotations

import os

from carstage.collector.internals.errors import OUT_OF_SPACE, DiskFullError, RecordingError


def prepare_folder(folder: str) -> str:
    """Make the folder of a new attempt; return its absolute path.

    Raises:
        RecordingError: it holds something already, or cannot be made.
    """
    folder = os.path.abspath(folder)
    try:
        os.makedirs(folder, exist_ok=True)
        if os.listdir(folder):
            raise RecordingError(
                "The attempt's folder %s is not empty." % folder,
                "Give every attempt a new folder; nothing is overwritten.",
            )
    except OSError as error:
        kind = DiskFullError if error.errno in OUT_OF_SPACE else RecordingError
        raise kind(
            "The attempt's folder %s cannot be made: %s." % (folder, error.strerror),
            "Check the path, the rights and the space of the output folder.",
        ) from error
    return folder
