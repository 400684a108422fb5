"""What can go wrong while recording; each error says what happened and what to do next."""

from __future__ import annotations

import errno

OUT_OF_SPACE = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG))
"""No space on the disk, none left of the user's quota, a file larger than may be."""


class CollectorError(Exception):
    """Base of the collector's errors.

    Args:
        message: one sentence: what happened and where (episode, frame, sensor).
        hint: one sentence: what to do next.
    """

    kind = "collector"
    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class PlanError(CollectorError):
    """The plan is not valid; nothing was started. The message begins with the field's path."""

    kind = "plan"
    exit_code = 2


class ConnectionFailedError(CollectorError):
    """No CARLA server answered at the planned address."""

    kind = "connection"


class VersionMismatchError(CollectorError):
    """Client, server and plan are not of one CARLA version."""

    kind = "version"


class SceneError(CollectorError):
    """The server cannot make the planned scene: unknown map, blueprint, attribute, spawn point."""

    kind = "scene"


class DriverError(CollectorError):
    """The ego's driver is not found, raised, or answers what is no control."""

    kind = "driver"


class RecordingError(CollectorError):
    """The recording itself broke: a sensor died, a frame was lost, the disk refused."""

    kind = "recording"


class DiskFullError(RecordingError):
    """There is no space left for the recording."""

    kind = "disk"


def writing_failed(error: OSError) -> RecordingError:
    """The error to raise when the raw log cannot be written."""
    kind = DiskFullError if error.errno in OUT_OF_SPACE else RecordingError
    return kind(
        "Writing the raw log failed: %s." % error,
        "Check the space and the rights of the output folder.",
    )


class InterruptedByRequestError(CollectorError):
    """Somebody asked the collector to end: a signal, a closed pipe."""

    kind = "interrupted"
    exit_code = 130


_RAN_OUT_OF_TIME = ("time-out of", "failed to connect to newly created map")
"""How the client words it."""


def ran_out_of_time(error: BaseException) -> bool:
    """Whether this is the client's word that the server did not answer in time."""
    return isinstance(error, RuntimeError) and any(w in str(error) for w in _RAN_OUT_OF_TIME)


def client_hint(error: RuntimeError) -> str:
    """What to do about an error of the client."""
    hint = "See the server's log."
    if ran_out_of_time(error):
        hint += " A server that is only slow needs a longer supervision.hang_s."
    return hint
