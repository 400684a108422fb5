"""The newest pictures of runs that somebody watches; of others none are made.

Imports nothing that draws: ``carstage.web.preview.previewer`` does, in a separate process.
"""

from __future__ import annotations

import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from carstage.files.bounded import read_bounded
from carstage.runs.reading import read_document
from carstage.sensor_kinds import known_kind
from carstage.web.messages import Channel, RunSensor

FOLDER, WANT, INDEX = "preview", "want", "index.json"
_HEADER = struct.Struct("<B3xI")
_TOUCH_EVERY_S = 1.0
_START_EVERY_S = 3.0
_MOST_CHANNELS = 250


class Previews:
    """Writes which run is watched, starts the previewer, reads its pictures."""

    def __init__(self) -> None:
        self._touched_s: dict[Path, float] = {}
        self._started_s: dict[Path, float] = {}
        self._processes: dict[Path, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()

    def channels(self, sensors: Sequence[RunSensor]) -> list[Channel]:
        """The channels of a run's sensors that can be shown, in the rig's order."""
        shown = [one for one in sensors if _viewer(one) != "none"][:_MOST_CHANNELS]
        return [
            Channel(channel=number, sensor_id=sensor.id, kind=_viewer(sensor))  # type: ignore[arg-type]
            for number, sensor in enumerate(shown)
        ]

    def want(self, run: Path) -> None:
        """Somebody watches a run: refresh the sign, and have a previewer at work."""
        with self._lock:
            now_s = time.monotonic()
            folder = run / FOLDER
            if now_s - self._touched_s.get(run, -_TOUCH_EVERY_S) >= _TOUCH_EVERY_S:
                with suppress(OSError):  # the run was removed
                    folder.mkdir(exist_ok=True)
                    (folder / WANT).touch()
                self._touched_s[run] = now_s
            process = self._processes.get(run)
            if process is not None and process.poll() is None:
                return
            if now_s - self._started_s.get(run, -_START_EVERY_S) < _START_EVERY_S:
                return
            self._started_s[run] = now_s
            # One that an earlier server has started makes the new one end at once.
            self._processes[run] = subprocess.Popen(
                [sys.executable, "-m", "carstage.web.preview.previewer", str(run)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def ticks(self, run: Path) -> dict[str, int]:
        """The tick of the newest picture by sensor."""
        index = read_document(run / FOLDER / INDEX) or {}
        return {
            name: entry["tick"]
            for name, entry in index.items()
            if isinstance(entry, dict) and isinstance(entry.get("tick"), int)
        }

    def packet(self, run: Path, channel: Channel, tick: int) -> bytes | None:
        """The binary message for a channel; None when the picture is gone."""
        suffix = ".jpg" if channel.kind == "image" else ".f32"
        try:
            content = read_bounded(run / FOLDER / f"{channel.sensor_id}{suffix}")
        except OSError:
            return None
        return _HEADER.pack(channel.channel, tick & 0xFFFFFFFF) + content

    def close(self) -> None:
        """End the previewers that were started here; runs stay."""
        with self._lock:
            for process in self._processes.values():
                process.terminate()
            for process in self._processes.values():
                process.wait()
            self._processes.clear()


def _viewer(sensor: RunSensor) -> str:
    """What shows the sensor's frames; ``none`` also for a kind that is not known here."""
    kind = known_kind(sensor.kind)
    return "none" if kind is None else kind.viewer
