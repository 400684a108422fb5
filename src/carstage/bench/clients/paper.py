"""``python -m carstage.bench.clients.paper PLAN.json``: the paper's design of capture.

Callbacks hand their data to a thread pool, which copies them into memory-mapped files, one for each
sensor and simulated second; after the last tick a process pool makes PNG files from these. The
encoder is OpenCV with its defaults; ``--encoder carstage`` takes Car-STAGE's own instead, to tell
what the design costs from what the encoder does.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from carstage.bench.clients.scene_session import Arrivals, SceneSession, run_program

_WAITING_PER_THREAD = 8


class RawSecond(NamedTuple):
    """A memory-mapped file: where, ``(height, width)``, its first tick and how many there are."""

    path: Path
    shape: tuple[int, int]
    first_tick: int
    pictures: int


class MappedSeconds:
    """Memory-mapped files of one sensor, each of as many pictures as a second has.

    Args:
        folder: where they go.
        per_second: pictures of a file.
    """

    def __init__(self, folder: Path, per_second: int) -> None:
        self._folder = folder
        self._per_second = per_second
        self._lock = threading.Lock()
        self._maps: dict[int, Any] = {}

    def put(self, tick: int, image: Any) -> None:
        """Copy a picture to its place."""
        second, place = divmod(tick, self._per_second)
        with self._lock:
            if second not in self._maps:
                for old in [known for known in self._maps if known < second - 1]:
                    del self._maps[old]
                self._maps[second] = np.memmap(
                    self.path(second),
                    np.uint8,
                    "w+",
                    shape=(self._per_second, image.height, image.width, 4),
                )
            mapped = self._maps[second]
        mapped[place] = np.frombuffer(image.raw_data, np.uint8).reshape(mapped.shape[1:])

    def path(self, second: int) -> Path:
        """The file of a second."""
        return self._folder / f"second{second:06d}.raw"


def record(session: SceneSession, options: argparse.Namespace) -> None:
    """Capture; convert when the scene is gone."""
    per_second = max(1, round(1.0 / session.spec.step_s))
    seconds = {name: MappedSeconds(session.folder / name, per_second) for name in session.sensors}
    shapes = _capture(session, seconds)
    jobs = [
        RawSecond(
            seconds[name].path(second),
            shape,
            second * per_second,
            min(per_second, session.spec.steps - second * per_second),
        )
        for name, shape in sorted(shapes.items())
        for second in range(-(-session.spec.steps // per_second))
    ]
    # A process that forks while the client has threads may abort when it ends.
    session.afterwards.append(lambda: _convert_all(jobs, options.encoder))


def _convert_all(jobs: list[RawSecond], encoder: str) -> None:
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for _ in pool.map(partial(convert, encoder=encoder), jobs):
            pass


def _capture(
    session: SceneSession, seconds: dict[str, MappedSeconds]
) -> dict[str, tuple[int, int]]:
    threads = len(os.sched_getaffinity(0))
    room = threading.BoundedSemaphore(threads * _WAITING_PER_THREAD)
    arrivals = Arrivals(session)
    jobs: list[Future[None]] = []
    shapes: dict[str, tuple[int, int]] = {}
    first = [sys.maxsize]
    with ThreadPoolExecutor(threads) as pool:

        def callback(name: str) -> Callable[[Any], None]:
            def keep(image: Any) -> None:
                tick = image.frame - first[0]
                if tick >= 0:
                    shapes[name] = (image.height, image.width)
                    room.acquire()
                    job = pool.submit(seconds[name].put, tick, image)
                    job.add_done_callback(lambda _: room.release())
                    jobs.append(job)
                arrivals.done(name, image.frame)

            return keep

        callbacks = {name: callback(name) for name in session.scene.rig.actors}
        last = session.warm_up(lambda: session.scene.rig.listen(callbacks), arrivals.wait_for)
        first[0] = last + 1
        for tick in range(session.spec.steps):
            arrivals.wait_for(session.step(tick).frame)
    for job in jobs:
        job.result()
    return shapes


def convert(raw: RawSecond, encoder: str) -> None:
    """Make the PNG files of one sensor and second, and remove the raw one."""
    height, width = raw.shape
    per_file = raw.path.stat().st_size // (height * width * 4)
    pictures = np.memmap(raw.path, np.uint8, "r", shape=(per_file, height, width, 4))
    for place in range(raw.pictures):
        target = raw.path.with_name(f"{raw.first_tick + place:06d}.png")
        if encoder == "opencv":
            import cv2

            cv2.imwrite(str(target), pictures[place, :, :, :3])
        else:
            target.write_bytes(_own_png(pictures[place]))
    del pictures
    raw.path.unlink()


def _own_png(bgra: Any) -> bytes:
    from carstage.codecs import codec_for

    height, width, _ = bgra.shape
    (content,) = codec_for("rgb")[1].encode(
        {"width": width, "height": height}, memoryview(bytearray(bgra))
    )
    return bytes(content)


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--encoder", choices=("opencv", "carstage"), default="opencv")


def main() -> int:
    """Record one episode."""
    return run_program(record, __doc__, _add_options)


if __name__ == "__main__":
    sys.exit(main())
