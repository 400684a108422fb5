"""Small pictures of what a run records now: ``python -m carstage.web.preview.previewer FOLDER``.

A separate process: drawing takes no time from the run's processes nor from the server. It works
only while somebody watches, which a fresh ``preview/want`` shows, and only once per run.
It reads the raw log that is being written and leaves, for each sensor, the newest picture:
``preview/<sensor>.jpg`` or ``.f32``, each replaced as a whole, and ``preview/index.json`` with
their ticks, written last.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.point_sensors import radar_detections
from carstage.codecs import codec_for
from carstage.codecs.codec import image_bgra
from carstage.conversion.flash_lidar import flash_points, is_by_rays, ray_points
from carstage.conversion.tag_numbers import dataset_payload
from carstage.files.locks import take_lock
from carstage.files.whole import write_whole
from carstage.rawlog.tail import NewestRecords, NewRecord
from carstage.report.drawing import camera_view
from carstage.runs.folder import FINAL_STATES
from carstage.runs.reading import read_document
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.columns import Point
from carstage.sensor_kinds.model import CLOUDS, DETECTIONS
from carstage.spec import EpisodeSpec, SensorSpec
from carstage.web.preview.sensor_views import PALETTE, jpeg, points_of, scaled
from carstage.web.preview.shown_sensors import ShownSensor, shown_sensors

FOLDER = "preview"
WANT = "want"
INDEX = "index.json"
WANT_S = 4.0
"""How old ``want`` may be; whoever watches refreshes it each second."""
_ROUND_S = 0.05
_PICTURE_EVERY_S = 0.1
"""At most ten pictures of a sensor in a second on average: one that gives ten is shown whole."""
_WIDTH = 640
_MOST_POINTS = 6000
_NICE = 5


def main(run: Path) -> int:
    """Draw until nobody watches or the run is over."""
    with suppress(OSError):
        os.nice(_NICE)
    folder = run / FOLDER
    with _only_previewer(folder) as is_only:
        if is_only:
            _draw(run, folder)
    return 0


def _draw(run: Path, folder: Path) -> None:
    pause = threading.Event()
    attempt: Path | None = None
    streams: list[_Stream] = []
    ticks: dict[str, dict[str, float]] = {}
    while _wanted(folder):
        begin_s = time.monotonic()
        status = read_document(run / "status.json") or {}
        if status.get("state") in FINAL_STATES:
            return
        newest = _attempt(run, status)
        if newest != attempt and newest is not None:
            streams = _streams(newest)
            attempt = newest if streams else None
        drawn = False
        for stream in streams:
            tick = stream.draw(folder)
            if tick is not None:
                ticks[stream.id] = {"tick": tick, "time": time.time()}
                drawn = True
        if drawn:
            write_whole(folder / INDEX, json.dumps(ticks).encode())
        pause.wait(max(_ROUND_S / 5, _ROUND_S - (time.monotonic() - begin_s)))


class _Stream:
    """One sensor of one attempt."""

    def __init__(self, attempt: Path, shown: ShownSensor, server: str) -> None:
        self.id = shown.id
        self._sensor = shown.sensor
        self._server = server
        self._records = NewestRecords(attempt, shown.stream)
        self._next_s = 0.0

    def draw(self, folder: Path) -> int | None:
        """Draw the newest record, if there is a new one; its tick."""
        now_s = time.monotonic()
        record = self._records.look() if now_s >= self._next_s else None
        if record is None:
            return None
        self._next_s = max(self._next_s, now_s - _PICTURE_EVERY_S) + _PICTURE_EVERY_S
        suffix = ".jpg" if sensor_kind(self._sensor.kind).is_camera else ".f32"
        drawn = draw_sensor(self._sensor, self._server, record)
        write_whole(folder / f"{self.id}{suffix}", drawn)
        return record.tick


def draw_sensor(
    sensor: SensorSpec,
    server: str,
    record: NewRecord,
    width: int = _WIDTH,
    most_points: int = _MOST_POINTS,
) -> bytes:
    """As :func:`draw_record`; of a flash LiDAR points of its rays, or of its picture ahead."""
    if sensor.flash is None:
        return draw_record(sensor.kind, server, record, width, most_points)
    if is_by_rays(sensor):
        points = ray_points(sensor, record.meta, record.payload, record.tick)
        return _thinned(points[:, : Point.INTENSITY + 1], most_points)
    ahead = image_bgra(record.meta, memoryview(record.payload))
    nothing_hit = np.full_like(ahead, 255)
    pictures = np.stack([ahead, *(nothing_hit for _ in sensor.streams[1:])])
    points = flash_points(sensor, pictures, record.tick)
    return _thinned(points[:, : Point.INTENSITY + 1], most_points)


def draw_record(
    kind: str,
    server: str,
    record: NewRecord,
    width: int = _WIDTH,
    most_points: int = _MOST_POINTS,
) -> bytes:
    """JPEG of a camera's record; float32 ``(N, 4)`` of a LiDAR's or radar's.

    Args:
        kind: of the sensor.
        server: version of the server that it is from.
        record: from the raw log.
        width: of the picture, at most.
        most_points: of a LiDAR; of more, every n-th is taken.
    """
    content = sensor_kind(kind).content
    if content == DETECTIONS:
        return points_of(content, radar_detections(kind, record.payload)).tobytes()
    payload = memoryview(dataset_payload(kind, server, memoryview(record.payload)))
    data = codec_for(kind)[1].raw_array(record.meta, payload)
    if content in CLOUDS:
        return _thinned(points_of(content, data), most_points)
    return jpeg(scaled(camera_view(content, data, PALETTE), width))


def _thinned(points: NDArray[np.float32], most: int) -> bytes:
    """At most so many points, every n-th one."""
    return points[:: max(1, -(-len(points) // most))].tobytes()


def _attempt(run: Path, status: Mapping[str, Any]) -> Path | None:
    """Folder of the raw log that is being written, once it has begun."""
    current = status.get("current")
    if not isinstance(current, dict):
        return None
    folder = run / "raw" / str(current["episode_id"]) / str(current["attempt"])
    return folder if (folder / "episode.json").is_file() else None


def _streams(attempt: Path) -> list[_Stream]:
    header = read_document(attempt / "episode.json")
    if header is None:
        return []
    return [
        _Stream(attempt, shown, str(header["server_version"]))
        for shown in shown_sensors(EpisodeSpec.from_json(header["spec"]))
        if sensor_kind(shown.sensor.kind).viewer != "none"
    ]


def _wanted(folder: Path) -> bool:
    try:
        return time.time() - (folder / WANT).stat().st_mtime < WANT_S
    except OSError:
        return False


@contextmanager
def _only_previewer(folder: Path) -> Iterator[bool]:
    """Whether no other process draws this run; holds the place meanwhile."""
    try:
        held = take_lock(folder / ".lock", 0o644)
    except OSError:
        held = None
    with held or nullcontext():
        yield held is not None


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
