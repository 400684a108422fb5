"""One attempt: from sealed segments of a raw log to the files of an episode."""

from __future__ import annotations

import json
import math
import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from carstage.conversion import work
from carstage.conversion.encoded import EncodedSegment, parts_folder
from carstage.conversion.sensors import ROWS_CODEC, SensorPlan, plan_sensors
from carstage.conversion.town import Town
from carstage.errors import ConversionError, ConverterDiedError
from carstage.files.hashing import hash_of
from carstage.rawlog.format import LEDGER, WORLD
from carstage.rawlog.reader import EpisodeLog
from carstage.storage.attempt_files import AttemptFiles
from carstage.storage.marker import FileEntry

_LOOK_S = 0.2
_MOST_TOWNS = 4
_towns: dict[tuple[str, str], Town] = {}
"""What was made of the last towns, by the hash of the text and the place on the globe."""
_towns_lock = threading.Lock()
_LABELS = ""
"""Key of the label task among a segment's tasks; no stream has an empty name."""
_VOXELS = "/"
"""Key of the task that places voxels; no stream has such a name."""


@dataclass(frozen=True, slots=True)
class Converted:
    """What a conversion came to.

    Attributes:
        frames: saved frames; asynchronous recording may skip some of those that were planned.
        files: what the workers wrote, hashed from memory; tables and documents are not among them.
        opendrive: the town's OpenDRIVE text, which ``episode.json`` names by its hash; None where
            it was not recorded.
        vector_map: the town's vector map, which it names likewise; None where there is none.
    """

    frames: int
    files: tuple[FileEntry, ...]
    opendrive: bytes | None
    vector_map: bytes | None


class EpisodeConversion:
    """Converts one attempt while or after it is recorded.

    A segment's work is handed to the pool once the segment is sealed in every stream that the
    work reads; segments may be announced in any order, more than once, from any thread. The files
    depend on the raw log and ``codecs`` alone: the same log gives the same bytes.

    Construct it when the raw log's ``episode.json`` is there or will be before the first segment
    is announced. Until ``finish`` returns, the attempt is incomplete.

    Args:
        raw_folder: folder of the attempt's raw log.
        attempt_files: receives the files.
        pool: where the work is done, see ``process_pool``; the caller shuts it down.
        codecs: name of the codec by sensor id, where it is not the default of the sensor's kind.
        progress: called whenever some work is done, well or not; from any thread.
        left_s: seconds for which work that is to be dropped may be waited for.
        agent: name of an agent beside the ego, which is taken for the ego: of its sensors, and as
            seen from it, are the files. ``carstage.conversion.fleet`` converts all of an attempt.
    """

    def __init__(
        self,
        raw_folder: Path,
        attempt_files: AttemptFiles,
        pool: Executor,
        *,
        codecs: Mapping[str, str] = MappingProxyType({}),
        progress: Callable[[], None] = lambda: None,
        left_s: Callable[[], float] = lambda: math.inf,
        agent: str | None = None,
    ) -> None:
        self._agent = agent
        self.raw_folder = Path(raw_folder)
        self.attempt_files = attempt_files
        self._pool = pool
        self._codecs = codecs
        self._progress = progress
        self._left_s = left_s
        # Entered again by who asks for progress: a task that is done at once tells it while the
        # scan that handed it out still holds the lock.
        self._lock = threading.RLock()
        self._log: EpisodeLog | None = None
        self._plan = SensorPlan((), frozenset())
        self._tasks: dict[tuple[int, str], Future[Any]] = {}
        self._sealed: set[tuple[str, int]] = set()
        self._unread: set[tuple[str, int]] = set()
        self._rest: Future[Town] | None = None
        self._finished = False

    @property
    def frames_done(self) -> int:
        """Number of saved frames that are converted, for progress bars.

        A segment counts in proportion to its finished tasks.
        """
        with self._lock:
            if self._log is None:
                return 0
            tasks_per_segment = len(self._plan.written) + 1
            per_segment = int(self._log.header["ticks_per_segment"])
            ticks = int(self._log.header["ticks"])
            done: dict[int, int] = {}
            for (segment, name), task in self._tasks.items():
                done[segment] = done.get(segment, 0) + (name != _VOXELS and task.done())
            return sum(
                self._frames_in(segment * per_segment, min((segment + 1) * per_segment, ticks))
                * count
                // tasks_per_segment
                for segment, count in done.items()
            )

    def segment_sealed(self, stream: str, segment: int) -> None:
        """Take note of a sealed segment and hand out the work that it completes; cheap.

        Raises:
            RawLogError: the raw log has no readable ``episode.json``.
            BadInputError: ``codecs`` names a codec or a sensor that does not exist.
            ConversionError: the pool's processes have died.
        """
        with self._lock:
            self._load()
            self._note(stream, segment)

    def use(self, pool: Executor) -> None:
        """Hand further work to another pool, as the first one broke."""
        with self._lock:
            self._pool = pool

    def scan(self) -> None:
        """Pick up every segment that is sealed already: deferred conversion, or a resumed one."""
        with self._lock:
            log = self._load()
            streams = self._plan.label_streams | {s.id for s in self._plan.written}
            for stream in sorted(streams):
                for segment in log.sealed_segments(stream):
                    self._note(stream, segment)

    def converted(self) -> list[dict[str, Any]]:
        """What is done, as plain values of JSON, for :meth:`go_on` of another conversion."""
        with self._lock:
            tasks = sorted(self._tasks.items())
        done = []
        for (segment, name), task in tasks:
            if _is_well_done(task):
                done.append({"segment": segment, "task": name, **asdict(task.result())})
        return done

    def go_on(self, converted: Sequence[Mapping[str, Any]]) -> None:
        """Take over what an earlier conversion into the same folder has done.

        Files are read again: what they hold must be what was written.

        Args:
            converted: as :meth:`converted` gave it.

        Raises:
            ConversionError: a file is not what was written, or ``converted`` is damaged.
            RawLogError: the raw log has no readable ``episode.json``.
        """
        with self._lock:
            self._load()
            for entry in converted:
                task: Future[Any] = Future()
                try:
                    files = tuple(FileEntry(**file) for file in entry["files"])
                    for file in files:
                        self._require_as_written(file)
                    encoded = EncodedSegment(tuple(entry["rows"]), files)
                    key = (int(entry["segment"]), str(entry["task"]))
                except (KeyError, TypeError, ValueError) as error:
                    raise ConversionError(
                        f"What was converted of {self.raw_folder} is not told rightly: {error!r}.",
                        "Record the episode again.",
                    ) from error
                task.set_result(encoded)
                self._tasks[key] = task

    def _require_as_written(self, entry: FileEntry) -> None:
        try:
            same = self.attempt_files.holds(entry)
        except OSError as error:
            raise ConversionError(
                f"{entry.path} cannot be read: {error.strerror}.", "Record the episode again."
            ) from error
        if not same:
            raise ConversionError(
                f"{entry.path} is not as it was written.", "Record the episode again."
            )

    def raise_if_failed(self) -> None:
        """Raise the first error of the work done so far, as ``finish`` would."""
        with self._lock:
            tasks = [task for _, task in sorted(self._tasks.items()) if task.done()]
        for task in tasks:
            _raise_error_of(task)

    def remove_converted(self) -> None:
        """Remove raw segments of sensors that no work will read any more; cheap to ask often.

        For recordings that are made anew where anything fails: what is removed cannot be converted
        again. What is given back at once is used for the next frames.
        """
        with self._lock:
            for stream, segment in [one for one in self._unread if self._is_read(*one)]:
                self._load().remove_segment(stream, segment)
                self._unread.remove((stream, segment))

    def is_written(self) -> bool:
        """Whether nothing is left to do but to :meth:`finish`, once all frames are converted.

        Cheap to ask often; hands out what is left of the work, as far as it is possible now.

        Raises:
            ConversionError: the recording is not whole, or of another map than was asked for.
            RawLogError: it is damaged.
        """
        with self._lock:
            log = self._load()
            if self._lacking(log) is not None:
                self.scan()
            if self._lacking(log) is not None:
                return True  # `finish` tells it, and what has failed
            tasks = [*self._tasks.values(), *self._place_voxels(log)]
            if not all(task.done() for task in tasks):
                return False
            if self._rest is None and all(map(_is_well_done, tasks)):
                self._write_rest()
            return self._rest is None or self._rest.done()

    def finish(self) -> Converted:
        """Wait for all work, that on what belongs to the whole episode included.

        Raises:
            ConversionError: the recording is incomplete, or work on it failed.
            CarStageError: as the work raised it.
        """
        self.scan()
        with self._lock:
            log = self._load()
            tasks = [task for _, task in sorted(self._tasks.items())]
        ledger = log.ledger()
        if len(ledger) != int(log.header["ticks"]):
            raise ConversionError(
                f"Episode {log.header['episode_id']}: only {len(ledger)} of "
                f"{log.header['ticks']} ticks are recorded.",
                "Record the episode again.",
            )
        self._require_all_segments(log)
        try:
            for task in tasks:
                _raise_error_of(task)
            with self._lock:
                voxels = self._place_voxels(log)
            for task in voxels:
                _raise_error_of(task)
            with self._lock:
                rest = self._rest or self._write_rest()
            _raise_error_of(rest)
        except BaseException:
            self._drop_tasks()
            raise
        opendrive = log.opendrive()
        town = rest.result()
        _remember(self._town_key(log, opendrive), town)
        self._finished = True
        files = tuple(
            file
            for task in (*(sensor.id for sensor in self._plan.written), _LABELS, _VOXELS)
            for segment in log.segments
            if (segment, task) in self._tasks
            for file in self._tasks[segment, task].result().files
        )
        frames = sum(entry["k"] is not None for entry in ledger)
        return Converted(frames, files, opendrive, town.content)

    def remove_parts(self) -> None:
        """Remove what lies beside the raw log for the conversion alone, once nobody needs it."""
        with suppress(FileNotFoundError):
            shutil.rmtree(parts_folder(self.raw_folder, self._agent))

    def stop(self) -> None:
        """Hand out no more work, and drop what is not begun."""
        with self._lock:
            for task in self._all_tasks():
                task.cancel()

    def cancel(self) -> None:
        """Drop what is not done and remove the attempt's files; waits for running work.

        After ``finish`` has returned the files are the store's, and this does nothing.
        """
        self._drop_tasks()
        if self._finished:
            return
        self.attempt_files.discard()
        self.remove_parts()

    def _load(self) -> EpisodeLog:
        if self._log is None:
            log = EpisodeLog(self.raw_folder, self._agent)
            self._plan = plan_sensors(log.spec, self._codecs)
            self._log = log
        return self._log

    def _note(self, stream: str, segment: int) -> None:
        """Remember a seal; submit each task of the segment that it makes possible."""
        if (stream, segment) in self._sealed:
            return
        self._sealed.add((stream, segment))
        if stream not in (WORLD, LEDGER):  # `finish` reads those
            self._unread.add((stream, segment))
        for sensor in self._plan.written:
            if self._is_ready(segment, sensor.id, {*sensor.streams, LEDGER}):
                self._tasks[segment, sensor.id] = self._submit(
                    work.encode_segment, *self._arguments, sensor, segment, self._agent
                )
        if self._is_ready(segment, _LABELS, self._plan.label_streams):
            self._tasks[segment, _LABELS] = self._submit(
                work.label_segment, *self._arguments, segment, self._agent
            )

    def _submit(self, work: Callable[..., Any], *arguments: object) -> Future[Any]:
        try:
            task = self._pool.submit(work, *arguments)
        except BrokenExecutor as error:
            raise _worker_died() from error
        task.add_done_callback(lambda _: self._progress())
        return task

    @property
    def _arguments(self) -> tuple[Path, AttemptFiles]:
        return self.raw_folder, self.attempt_files

    def _is_ready(self, segment: int, task: str, streams: frozenset[str] | set[str]) -> bool:
        if (segment, task) in self._tasks:
            return False
        return all((stream, segment) in self._sealed for stream in streams)

    def _is_read(self, stream: str, segment: int) -> bool:
        """Whether all work that reads a stream's segment is done, and well."""
        tasks = [_LABELS] if stream in self._plan.label_streams else []
        tasks += [sensor.id for sensor in self._plan.written if stream in sensor.streams]
        return all(_is_well_done(self._tasks.get((segment, task))) for task in tasks)

    def _frames_in(self, first_tick: int, end_tick: int) -> int:
        assert self._log is not None
        saved = self._log.spec.saved
        return saved.count(end_tick) - saved.count(first_tick)

    def _lacking(self, log: EpisodeLog) -> tuple[int, str] | None:
        """A segment and the task of it that could not be handed out; None: there is none."""
        names = [*(sensor.id for sensor in self._plan.written), _LABELS]
        keys = ((segment, name) for segment in log.segments for name in names)
        return next((key for key in keys if key not in self._tasks), None)

    def _require_all_segments(self, log: EpisodeLog) -> None:
        lacking = self._lacking(log)
        if lacking is not None:
            segment, task = lacking
            raise ConversionError(
                f"Episode {log.header['episode_id']}: segment {segment} was never sealed "
                f"in every stream that {task or 'the labels'} needs.",
                "Record the episode again.",
            )

    def _place_voxels(self, log: EpisodeLog) -> list[Future[Any]]:
        """Hand out what needs the labels of all segments, once these are done."""
        asked, segments = log.spec.labels.occupancy, log.segments
        if asked is None or asked.exact:
            return []
        if all(_is_well_done(self._tasks.get((segment, _LABELS))) for segment in segments):
            for segment in segments:
                if (segment, _VOXELS) not in self._tasks:
                    self._tasks[segment, _VOXELS] = self._submit(
                        work.place_voxels, *self._arguments, segment, len(segments), self._agent
                    )
        return [self._tasks[key] for key in self._tasks if key[1] == _VOXELS]

    def _write_rest(self) -> Future[Town]:
        """Hand out the work on what belongs to the whole episode."""
        log = self._load()
        opendrive = log.opendrive()
        named = None if opendrive is None else hash_of(opendrive)
        if log.spec.opendrive not in (None, named):
            raise ConversionError(
                f"Episode {log.header['episode_id']}: the server's map {log.spec.map} is not the "
                "configuration's file.",
                "Did the file change during the run, or does another machine have another one?",
            )
        rows = {
            sensor.id: [r for i in log.segments for r in self._tasks[i, sensor.id].result().rows]
            for sensor in self._plan.written
            if sensor.codec == ROWS_CODEC
        }
        town = _known(self._town_key(log, opendrive))
        known = (dict(self._codecs), rows, named, town, self._agent)
        self._rest = self._submit(work.write_episode, *self._arguments, *known)
        return self._rest

    def _town_key(self, log: EpisodeLog, opendrive: bytes | None) -> tuple[str, str] | None:
        """Names the town whose vector map is wanted; None: none is."""
        if opendrive is None or not log.spec.labels.vector_map:
            return None
        return hash_of(opendrive), json.dumps(log.header["geo_reference"], sort_keys=True)

    def _all_tasks(self) -> list[Future[Any]]:
        return [*self._tasks.values(), *([] if self._rest is None else [self._rest])]

    def _drop_tasks(self) -> None:
        with self._lock:
            tasks = self._all_tasks()
        # A pool that has ended tells nobody of what was cancelled: to wait for that has no end.
        running = {task for task in tasks if not task.cancel()}
        while running and self._left_s() > 0:
            running = wait(running, _LOOK_S).not_done


def _is_well_done(task: Future[Any] | None) -> bool:
    return task is not None and task.done() and not task.cancelled() and task.exception() is None


def _known(town: tuple[str, str] | None) -> Town | None:
    """What was made of a town before, if it was one of the last."""
    with _towns_lock:
        return None if town is None else _towns.get(town)


def _remember(key: tuple[str, str] | None, town: Town) -> None:
    with _towns_lock:
        if key is not None and key not in _towns:
            while len(_towns) >= _MOST_TOWNS:
                del _towns[next(iter(_towns))]
            _towns[key] = town


def _raise_error_of(task: Future[Any]) -> None:
    """Wait for a task; raise its error."""
    try:
        task.result()
    except CancelledError as error:
        raise ConversionError("The conversion was cancelled.") from error
    except BrokenExecutor as error:
        raise _worker_died() from error


def _worker_died() -> ConverterDiedError:
    return ConverterDiedError(
        "A conversion process died, probably for lack of memory.",
        "Use fewer conversion workers or free some memory, then run the command again.",
    )
