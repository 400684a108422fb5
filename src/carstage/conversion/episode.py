"""One attempt: from sealed segments of a raw log to the files of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path


class EpisodeConversion:
    """Converts one attempt while or after it is recorded.

    Args:
        raw_folder: folder of the attempt's raw log.
        attempt_folder: folder below ``episodes/`` that receives the files.
        pool: where the work is done, see ``conversion_pool``.
        codecs: name of the codec by sensor id, where it is not the default of the sensor's kind.
    """

    def __init__(
        self,
        raw_folder: Path,
        attempt_folder: Path,
        pool: Executor,
        *,
        codecs: Mapping[str, str] = {},  # noqa: B006
    ) -> None:
        self.raw_folder = raw_folder
        self.attempt_folder = attempt_folder

    @property
    def frames_total(self) -> int:
        """Number of saved frames of the episode; 0 until the raw log's header is read."""
        raise NotImplementedError

    @property
    def frames_done(self) -> int:
        """Number of saved frames whose files and labels are all written."""
        raise NotImplementedError

    def segment_sealed(self, stream: str, segment: int) -> None:
        """Take note of a sealed segment; cheap."""
        raise NotImplementedError

    def scan(self) -> None:
        """Pick up every segment that is sealed already."""
        raise NotImplementedError

    def raise_if_failed(self) -> None:
        """Raise the first error of the work done so far."""
        raise NotImplementedError

    def finish(self) -> None:
        """Wait for all work and write what belongs to the whole episode."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Drop what is not done and remove the attempt's folder."""
        raise NotImplementedError
