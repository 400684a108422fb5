"""Every error that Car-STAGE raises on purpose: a base, typed subclasses, a way out in each."""

from __future__ import annotations


class CarStageError(Exception):
    """Base of all errors that a user may meet.

    Args:
        message: one sentence: what happened and where (field path, episode, frame, sensor, file).
        hint: one sentence: what to do next.
    """

    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".strip()


class BadInputError(CarStageError, ValueError):
    """The user asked for something that cannot be; nothing was started (exit code 2)."""

    exit_code = 2


class ConfigError(BadInputError):
    """A configuration value is wrong; the message begins with the field's path.

    Args:
        message: every problem with its path.
        hint: what to do next.
        problems: path, message and hint of each value at fault, for a form; empty where only the
            message tells.
    """

    def __init__(
        self,
        message: str,
        hint: str = "",
        problems: tuple[tuple[tuple[str | int, ...], str, str], ...] = (),
    ) -> None:
        super().__init__(message, hint)
        self.problems = problems


class ServerError(CarStageError, RuntimeError):
    """A CARLA server did not start, answer, or stay alive; carries the tail of its log."""


class ServerEndedError(ServerError):
    """A server ended while it started.

    Args:
        message: as of every error.
        hint: as of every error.
        status: of its process, negative for the signal that ended it.
    """

    def __init__(self, message: str, hint: str = "", status: int | None = None) -> None:
        super().__init__(message, hint)
        self.status = status

    @property
    def was_killed(self) -> bool:
        """Whether a signal ended it: another start may well succeed."""
        return self.status is not None and self.status < 0


class CollectorError(CarStageError, RuntimeError):
    """Recording an episode failed."""


class WorkerLostError(CarStageError, RuntimeError):
    """A worker's process died, or could not be started."""


class RawLogError(CarStageError, ValueError):
    """A raw log is damaged or of an unknown version."""


class AnnotationError(CarStageError, ValueError):
    """Labels cannot be computed from what was recorded."""


class ConversionError(CarStageError, RuntimeError):
    """A raw segment could not be turned into files."""


class ConverterDiedError(ConversionError):
    """A process that converts is gone; its pool takes no work any more."""


class ExportError(CarStageError, RuntimeError):
    """A dataset could not be written in another format."""


class StorageError(CarStageError, RuntimeError):
    """The store refused, lost or would silently overwrite something."""


class RequestGivenUpError(StorageError):
    """A store did not answer in the time that was left; what was asked for may be done or not."""


class DiskFullError(StorageError):
    """There is no space left where the run writes; another attempt would end alike."""


class StoreAccessError(StorageError, BadInputError):
    """An object store lets this user do nothing: credentials, permission, bucket, or clock."""

    exit_code = 2


class UnsafeStoreError(StoreAccessError):
    """A store replaces what exists without a word, so that commits could overwrite each other."""


class EpisodeExistsError(StorageError, FileExistsError):
    """Somebody else committed this episode first; the attempt that lost is removed."""


class DatasetError(CarStageError, ValueError):
    """A dataset is not readable: missing, damaged, or of an unknown format version (code 2)."""

    exit_code = 2


class VectorMapError(CarStageError, ValueError):
    """No vector map can be made of an OpenDRIVE text; says where in it, and what is wrong."""


class CatalogError(CarStageError, RuntimeError):
    """A catalog cannot be used: unreachable, refused, of a newer schema (exit code 2)."""

    exit_code = 2


class CatalogLostError(CatalogError):
    """The connection to a catalog broke while it was used; another try may succeed."""

    exit_code = 1
