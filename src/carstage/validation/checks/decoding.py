"""Frames of sensors read, hashed and decoded by threads, while the frames before are checked."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from carstage.dataset.reading import Sensor
from carstage.validation.checks.files import FileRead, VerifiedFiles

_FRAMES_AHEAD = 2


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """One frame of one sensor.

    Attributes:
        sensor: whose.
        files: as they were read, in the order of their names.
        array: what they hold; ``None``: they cannot be read, or do not decode.
        damage: why they do not decode.
    """

    sensor: Sensor
    files: Sequence[FileRead]
    array: NDArray[Any] | None = None
    damage: str | None = None


def decoded_frames(
    files: VerifiedFiles, frames: Iterable[tuple[int, Sequence[Sensor]]], threads: int
) -> Generator[tuple[int, list[DecodedFrame]], None, None]:
    """Frame after frame with its data, of which at most two are decoded ahead.

    Reading, hashing and decoding leave the interpreter's lock for most of their time.

    Args:
        files: reads them; nothing is reported.
        frames: each with the sensors that have files of it.
        threads: that decode.
    """
    waiting: deque[tuple[int, list[Future[DecodedFrame]]]] = deque()
    pool = ThreadPoolExecutor(threads, thread_name_prefix="decode")
    try:
        for k, sensors in frames:
            waiting.append((k, [pool.submit(decode, files, sensor, k) for sensor in sensors]))
            if len(waiting) > _FRAMES_AHEAD:
                yield _awaited(*waiting.popleft())
        while waiting:
            yield _awaited(*waiting.popleft())
    finally:
        pool.shutdown(cancel_futures=True)


def _awaited(k: int, tasks: Sequence[Future[DecodedFrame]]) -> tuple[int, list[DecodedFrame]]:
    return k, [task.result() for task in tasks]


def decode(files: VerifiedFiles, sensor: Sensor, k: int) -> DecodedFrame:
    """Read, verify and decode a frame of a sensor."""
    found = [files.look_at(name) for name in sensor.file_names(k)]
    contents = [one.content for one in found if one.content is not None]
    if len(contents) != len(found):
        return DecodedFrame(sensor, found)
    try:
        return DecodedFrame(sensor, found, sensor.decode(contents))
    except ValueError as error:
        return DecodedFrame(sensor, found, damage=str(error))
