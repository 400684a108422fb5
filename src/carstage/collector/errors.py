"""What can go wrong while recording; each error says what happened and what to do next."""

from __future__ import annotations


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


class RecordingError(CollectorError):
    """The recording itself broke: a sensor died, a frame was lost, the disk refused."""

    kind = "recording"


class InterruptedByRequestError(CollectorError):
    """Somebody asked the collector to end: a signal, a closed pipe."""

    kind = "interrupted"
    exit_code = 130
