"""Writer threads: bring records to the disk without holding up the tick, and seal segments."""

from __future__ import annotations

import threading
from queue import SimpleQueue
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from carstage.rawlog.format import LEDGER, Buffer, SealedSegment
from carstage.rawlog.writing import CHUNKLOG, StreamWriter
from carstage.spec import SavedSteps

LARGE_BYTES = 1 << 18
"""A stream with so many bytes per tick spends its writer's time in the kernel."""

MOST_WAITING_BYTES = 4_000_000
"""So much data of records is written at once."""

Content = Callable[[], Tuple[Mapping[str, Any], Buffer]]


class Write(NamedTuple):
    """One record to be written; ``content`` makes meta and payload in the writer's thread."""

    stream: str
    kind: int
    tick: int
    frame: int
    timestamp_s: float
    content: Content
    size_bytes: int


class _Seal(NamedTuple):
    stream: str
    last_tick: int


class _WriterThread:
    """One thread and the streams that only it writes.

    Attributes:
        waiting: records that are not with the kernel yet. A payload is a view that does not keep
            its data alive, so their tasks are kept.
        waiting_bytes: of their data.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.tasks: SimpleQueue[Any] = SimpleQueue()
        self.thread: Optional[threading.Thread] = None
        self.waiting: List[Write] = []
        self.waiting_bytes = 0


class LogWriters:
    """Writes the streams of one attempt on a few threads; a context manager.

    The queues hold no more than what the caller's byte budget lets in. The ledger has its own
    thread: it seals a segment only after every other stream has sealed that segment.

    Args:
        folder: the attempt's folder.
        expected_segment_bytes: stream to bytes that one segment is likely to take; the ledger not
            among them.
        ticks_per_segment: ticks per segment, the same in every stream.
        threads: threads for everything but the ledger.
        on_written: called with the sum of ``size_bytes`` of records once they are with the kernel.
        on_sealed: called with each sealed segment, from the writer's thread.
        on_failure: called with the error that ended a writer.
        stores: how payloads of a stream are stored, where not in its records.
        durable: see ``StreamWriter``.
        on_start: called first in each thread.
    """

    def __init__(
        self,
        folder: str,
        expected_segment_bytes: Mapping[str, int],
        ticks_per_segment: int,
        threads: int,
        on_written: Callable[[int], None],
        on_sealed: Callable[[SealedSegment], None],
        on_failure: Callable[[BaseException], None],
        stores: Optional[Mapping[str, str]] = None,
        durable: bool = True,
        on_start: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_written = on_written
        self._on_start = on_start
        self._on_sealed = on_sealed
        self._on_failure = on_failure
        self._ticks_per_segment = ticks_per_segment
        self._state = threading.Condition()
        self._sealed_streams: Dict[int, int] = {}
        self._closing = False
        self._writers: Dict[str, StreamWriter] = {}
        writer_threads = [_WriterThread("writer-%d" % number) for number in range(max(1, threads))]
        self._writer_threads = [*writer_threads, _WriterThread("writer-ledger")]
        self._thread_of: Dict[str, _WriterThread] = {LEDGER: self._writer_threads[-1]}
        # The largest streams first, so that no thread gets two of them while another has none.
        by_size = sorted(expected_segment_bytes, key=lambda name: -expected_segment_bytes[name])
        for number, stream in enumerate(by_size):
            self._thread_of[stream] = writer_threads[number % len(writer_threads)]
        for stream, size in [*expected_segment_bytes.items(), (LEDGER, 0)]:
            store = (stores or {}).get(stream, CHUNKLOG)
            self._writers[stream] = StreamWriter(
                folder, stream, ticks_per_segment, size, store=store, durable=durable
            )

    @property
    def streams(self) -> Sequence[str]:
        """Names of all streams, the ledger included."""
        return tuple(self._writers)

    def __enter__(self) -> LogWriters:
        for writer_thread in self._writer_threads:
            writer_thread.thread = threading.Thread(
                target=self._run, args=(writer_thread,), name=writer_thread.name
            )
            writer_thread.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what is queued, then end; what is not sealed stays behind as open segments."""
        *writer_threads, ledger = self._writer_threads
        self._end(writer_threads)
        # Only now is it settled which segments the ledger's thread may still seal.
        with self._state:
            self._closing = True
            self._state.notify_all()
        self._end([ledger])
        for writer in self._writers.values():
            writer.close()

    def _end(self, writer_threads: Sequence[_WriterThread]) -> None:
        for writer_thread in writer_threads:
            writer_thread.tasks.put(None)
        for writer_thread in writer_threads:
            if writer_thread.thread is not None:
                writer_thread.thread.join()

    def write(self, task: Write) -> None:
        """Queue one record; records of a stream are written in the order of these calls."""
        self._thread_of[task.stream].tasks.put(task)

    def seal(self, streams: Sequence[str], last_tick: int) -> None:
        """Queue the sealing of the segment that ends with ``last_tick``."""
        for stream in streams:
            self._thread_of[stream].tasks.put(_Seal(stream, last_tick))

    def wait_sealed(self, last_tick: int, timeout_s: float) -> bool:
        """Wait until all streams sealed the segment of ``last_tick``; return whether they did."""
        segment = last_tick // self._ticks_per_segment
        with self._state:
            return self._state.wait_for(
                lambda: self._sealed_streams.get(segment, 0) == len(self._writers), timeout_s
            )

    def _run(self, writer_thread: _WriterThread) -> None:
        try:
            self._on_start()
            for task in iter(writer_thread.tasks.get, None):
                if isinstance(task, Write):
                    self._write(task, writer_thread)
                else:
                    self._seal(task)
                # Records that came together are written together: system calls cost time, and a
                # page of the file that two of them share is handled twice.
                if writer_thread.tasks.empty() or writer_thread.waiting_bytes >= MOST_WAITING_BYTES:
                    self._flush(writer_thread)
            self._flush(writer_thread)
        except BaseException as error:  # noqa: BLE001 - handed to the main thread, which raises it
            self._on_failure(error)
            self._drain(writer_thread)

    def _drain(self, writer_thread: _WriterThread) -> None:
        """Give back the budget of what will never be written, so that nobody waits for it."""
        self._give_back(writer_thread)
        for task in iter(writer_thread.tasks.get, None):
            if isinstance(task, Write):
                self._on_written(task.size_bytes)

    def _write(self, task: Write, writer_thread: _WriterThread) -> None:
        writer_thread.waiting.append(task)
        writer_thread.waiting_bytes += task.size_bytes
        meta, payload = task.content()
        self._writers[task.stream].append(
            task.kind, task.tick, task.frame, task.timestamp_s, meta, payload, waits=True
        )

    def _flush(self, writer_thread: _WriterThread) -> None:
        for stream in {task.stream for task in writer_thread.waiting}:
            self._writers[stream].flush()
        writer_thread.waiting.clear()
        self._give_back(writer_thread)

    def _give_back(self, writer_thread: _WriterThread) -> None:
        size_bytes, writer_thread.waiting_bytes = writer_thread.waiting_bytes, 0
        if size_bytes:
            self._on_written(size_bytes)

    def _seal(self, task: _Seal) -> None:
        segment = task.last_tick // self._ticks_per_segment
        if task.stream == LEDGER and not self._others_sealed(segment):
            return
        sealed = self._writers[task.stream].seal(task.last_tick)
        self._on_sealed(sealed)
        with self._state:
            self._sealed_streams[segment] = self._sealed_streams.get(segment, 0) + 1
            if task.stream == LEDGER:  # nobody asks for an earlier one any more
                self._sealed_streams.pop(segment - 1, None)
            self._state.notify_all()

    def _others_sealed(self, segment: int) -> bool:
        others = len(self._writers) - 1
        with self._state:
            self._state.wait_for(
                lambda: self._closing or self._sealed_streams.get(segment, 0) >= others
            )
            return self._sealed_streams.get(segment, 0) >= others


def expected_segments(
    bytes_per_tick: Mapping[str, int], ticks_per_segment: int, saved_steps: SavedSteps
) -> Dict[str, int]:
    """Bytes that one segment of each stream is likely to take, to be reserved on disk."""
    saved = saved_steps.count(ticks_per_segment)
    return {stream: size * saved for stream, size in bytes_per_tick.items()}


def writer_threads(bytes_per_tick: Sequence[int]) -> int:
    """One thread per large stream, at most four."""
    large: List[int] = [size for size in bytes_per_tick if size >= LARGE_BYTES]
    return min(4, max(1, len(large)))
