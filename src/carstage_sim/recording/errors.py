"""What can go wrong with a log, worded as CARLA words it."""

from __future__ import annotations

from carstage_sim.world.errors import WorldError


class RecordingError(WorldError):
    """A log that cannot be written or read; the text reaches the client."""


class LogNotFoundError(RecordingError):
    """There is no file to read."""

    def __init__(self, path: object) -> None:
        super().__init__(f"File {path} not found on server\n")


class NotALogError(RecordingError):
    """A file that no recorder wrote."""

    def __init__(self) -> None:
        super().__init__("File is not a CARLA recorder\n")
