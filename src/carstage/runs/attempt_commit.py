"""From a recorded attempt to a committed episode."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carstage.conversion import FleetConversion
from carstage.errors import CarStageError, StorageError
from carstage.runs.pending import Pending, forget_pending, write_pending
from carstage.spec import EpisodeSpec
from carstage.storage import Store
from carstage.storage.disk import disk_error


@contextmanager
def _disk_errors(what: str) -> Iterator[None]:
    """Tell errors of the file system as ours, those of the converters' processes too."""
    try:
        yield
    except OSError as error:
        if isinstance(error, CarStageError):
            raise
        raise disk_error(error, what) from error


@dataclass(frozen=True, slots=True)
class Job:
    """An episode to record.

    Attributes:
        tries: attempts of it that have failed.
        first_attempt: lowest number that the next attempt may have.
    """

    spec: EpisodeSpec
    episode_id: str
    tries: int = 0
    first_attempt: int = 1


def _codecs_of(spec: EpisodeSpec, codecs: Mapping[str, str]) -> Mapping[str, str]:
    """Those of the episode's sensors: the rig of another variant may have more."""
    sensors = [*spec.written_sensors, *(one for agent in spec.agents for one in agent.sensors)]
    ids = {sensor.id for sensor in sensors}
    return {name: codec for name, codec in codecs.items() if name in ids}


class AttemptCommit:
    """One attempt on its way into the dataset.

    Args:
        job: the episode.
        attempt: name of the attempt; its folder exists.
        raw_folder: folder of its raw recording.
        store: where the episode is committed.
        pool: processes that convert.
        codecs: codec by sensor id, where it is not the kind's own.
        self_test: verdict on the server; None where it was not tested.
        deferred: nothing is converted before :meth:`convert_all`.
        progress: called whenever something is converted; from any thread.
        left_s: seconds for which what is being converted may be waited for.
    """

    def __init__(
        self,
        job: Job,
        attempt: str,
        raw_folder: Path,
        store: Store,
        pool: Executor,
        codecs: Mapping[str, str],
        self_test: Mapping[str, Any] | None = None,
        *,
        deferred: bool = False,
        progress: Callable[[], None] = lambda: None,
        left_s: Callable[[], float] = lambda: math.inf,
    ) -> None:
        self.job = job
        self.attempt = attempt
        self.raw_folder = raw_folder
        self._store = store
        self._codecs = codecs
        self._self_test = self_test
        self._deferred = deferred
        self._conversion = FleetConversion(
            job.spec,
            raw_folder,
            store.attempt_files(job.episode_id, attempt),
            pool,
            codecs=_codecs_of(job.spec, codecs),
            progress=progress,
            left_s=left_s,
        )

    @property
    def gnss(self) -> Mapping[str, str] | None:
        """``projection`` and ``north`` of the server's GNSS sensors, where a test found them."""
        return None if self._self_test is None else self._self_test["gnss"]

    @property
    def _what(self) -> str:
        return f"episode {self.job.episode_id}, attempt {self.attempt},"

    @property
    def frames_done(self) -> int:
        """Saved frames that are converted."""
        return self._conversion.frames_done

    def segment_sealed(self, stream: str, segment: int) -> None:
        """Hand a sealed segment to the conversion, unless that comes later.

        Raises:
            ConversionError: the converters take no work any more.
        """
        if not self._deferred:
            self._conversion.segment_sealed(stream, segment)

    def convert_all(self, pool: Executor) -> None:
        """Hand everything that is recorded to the conversion.

        Args:
            pool: the one of now; that of the attempt's begin may have broken since.

        Raises:
            CarStageError: the recording cannot be read, or the converters take no work any more.
        """
        with _disk_errors(self._what):
            self._conversion.use(pool)
            self._conversion.scan()

    def go_on(self, pending: Pending, pool: Executor) -> None:
        """Convert what an earlier run has recorded and kept.

        Raises:
            CarStageError: it cannot be read, or the converters take no work any more.
        """
        with _disk_errors(self._what):
            self._self_test = pending.self_test
            if pending.of_this_boot:  # else what was converted may have been lost with the power
                self._conversion.go_on(pending.converted)
            if not self._deferred:
                self.convert_all(pool)

    def set_aside(self, environment: Mapping[str, str], *, durable: bool) -> None:
        """Leave the recording, and what of it is converted, to the next run.

        Args:
            environment: what it was recorded with, by version.
            durable: whether its raw log was brought to the disk.

        Raises:
            StorageError: that cannot be written down.
        """
        self._conversion.stop()
        converted = self._conversion.converted()
        pending = Pending(self._codecs, environment, self._self_test, durable, converted)
        write_pending(self.raw_folder, pending)

    def leave(self, pending: Pending) -> None:
        """Give back to the next run what :meth:`go_on` could not take over.

        Raises:
            StorageError: that cannot be written down.
        """
        write_pending(self.raw_folder, pending)

    def cancel(self) -> None:
        """Convert no more than what is being converted."""
        self._conversion.stop()

    def remove_converted(self) -> None:
        """Remove what of the raw recording is converted; the rest goes with :meth:`remove_raw`."""
        with suppress(OSError):
            self._conversion.remove_converted()

    def is_ready(self) -> bool:
        """Whether all is converted; cheap to ask often.

        Raises:
            CarStageError: converting it failed.
        """
        with _disk_errors(self._what):
            self._conversion.raise_if_failed()
            all_frames = self._conversion.frames_done >= self.job.spec.saved_frames
            return all_frames and self._conversion.is_written()

    def commit(self) -> int:
        """Make the episode part of the dataset, once :meth:`is_ready` says so.

        Returns:
            The number of its frames.

        Raises:
            EpisodeExistsError: another run was faster; the attempt is removed.
            CarStageError: converting or committing failed.
        """
        with _disk_errors(self._what):
            converted = self._conversion.finish()
            if converted.opendrive is not None:
                self._store.keep_map(converted.opendrive)
            if converted.vector_map is not None:
                self._store.keep_map(converted.vector_map, "parquet")
            header = json.loads((self.raw_folder / "episode.json").read_bytes())
            self._store.commit(
                self.job.episode_id,
                self.attempt,
                frames=converted.frames,
                versions={
                    "client": str(header["client_version"]),
                    "server": str(header["server_version"]),
                },
                hashed=converted.files,
                self_test=self._self_test,
            )
            forget_pending(self.raw_folder)
            self._conversion.remove_parts()
        return converted.frames

    def remove_raw(self) -> None:
        """Remove the raw recording."""
        shutil.rmtree(self.raw_folder, ignore_errors=True)
        with suppress(OSError):  # other attempts may stand beside it
            self.raw_folder.parent.rmdir()

    def give_up(self) -> None:
        """Remove all that the attempt has written; a committed one stays."""
        self._conversion.cancel()
        with suppress(StorageError):
            self._store.discard_attempt(self.job.episode_id, self.attempt)
        self.remove_raw()
