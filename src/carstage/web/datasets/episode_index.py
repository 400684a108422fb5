"""What lists say of episodes, kept between starts: a large dataset is not read anew to open it."""

from __future__ import annotations

import json
import re
import threading
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from carstage.errors import DatasetError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.files.whole import write_whole
from carstage.runs.reading import read_document
from carstage.sensor_kinds import known_kind
from carstage.sensor_kinds.model import CAMERAS, COLOUR
from carstage.spec import EpisodeSpec
from carstage.storage.marker import CommitMarker, read_marker
from carstage.storage.remote_path import DatasetPath

_FORMAT = 1
_MOST_KEPT = 100_000
#: A marker as ``CommitMarker.to_bytes`` writes it: its head, and each file's size. A marker of
#: thousands of files is read so in a fifth of the time.
_HEAD = re.compile(
    rb'\{\s*"format_version": 2,\s*"episode_id": "([\w.-]+)",\s*"attempt": "([\w.-]+)",'
    rb'\s*"frames": (\d+),\s*"files": \['
)
_SIZE = re.compile(rb'"bytes": (\d+)')


@dataclass(frozen=True, slots=True)
class EpisodeFacts:
    """An episode as lists show it.

    Attributes:
        thumbnail: a camera whose pictures show it; empty: it has none.
    """

    episode_id: str
    attempt: str
    frames: int
    bytes: int
    index: int
    map: str
    weather: str
    saved_fps: float
    duration_s: float
    sensors: int
    thumbnail: str


class EpisodeIndex:
    """Facts by marker, read once for each state of it; safe to use from several threads.

    Args:
        file: where they are kept; what is there is only taken for markers of the same time and
            size.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._saving = threading.Lock()
        self._facts: dict[str, tuple[int, int, EpisodeFacts]] = {}
        self._changed = False
        kept = read_document(file) or {}
        if kept.get("format_version") == _FORMAT:
            for path, entry in kept.get("episodes", {}).items():
                self._take(path, entry)

    def facts(self, marker: DatasetPath, changed_s: float) -> EpisodeFacts:
        """The facts of an episode.

        Args:
            marker: its commit marker.
            changed_s: when it was written, as a listing of its folder says, Unix time. A store is
                asked no more than that; a marker of this machine is looked at itself.

        Raises:
            OSError: there is no such marker.
            DatasetError: it, or the episode's own document, is damaged.
        """
        state = (round(changed_s * 1e9), 0)
        if isinstance(marker, Path):
            status = marker.stat()
            state = (status.st_mtime_ns, status.st_size)
        key = str(marker)
        with self._lock:
            known = self._facts.get(key)
        if known is not None and known[:2] == state:
            return known[2]
        read = _read(marker)
        with self._lock:
            self._facts[key] = (*state, read)
            self._changed = True
        return read

    def save(self) -> None:
        """Keep what is new for the next start."""
        with self._saving:  # one at a time: all write to the same hidden name first
            with self._lock:
                if not self._changed:
                    return
                self._changed = False
                while len(self._facts) > _MOST_KEPT:
                    self._facts.pop(next(iter(self._facts)))
                episodes = {
                    path: [changed_ns, size, list(asdict(facts).values())]
                    for path, (changed_ns, size, facts) in self._facts.items()
                }
            document = {"format_version": _FORMAT, "episodes": episodes}
            write_whole(self._file, json.dumps(document).encode())

    def _take(self, path: str, entry: Any) -> None:
        try:
            changed_ns, size, values = entry
            if len(values) == len(fields(EpisodeFacts)):
                self._facts[path] = int(changed_ns), int(size), EpisodeFacts(*values)
        except (TypeError, ValueError):
            self._changed = True  # it is read anew, and written right


def _read(marker: DatasetPath) -> EpisodeFacts:
    content = read_bounded(marker, LARGEST_DOCUMENT_BYTES)
    head = _HEAD.match(content)
    if head is not None and content.rstrip().endswith(b"}"):
        episode_id, attempt, frames = head[1].decode(), head[2].decode(), int(head[3])
        size = sum(map(int, _SIZE.findall(content, head.end())))
    else:
        whole: CommitMarker = read_marker(marker)
        episode_id, attempt, frames = whole.episode_id, whole.attempt, whole.frames
        size = sum(entry.bytes for entry in whole.files)
    path = marker.parent.parent / "episodes" / episode_id / attempt / "episode.json"
    try:
        document = json.loads(read_bounded(path, LARGEST_DOCUMENT_BYTES))
        spec = EpisodeSpec.from_json(document["spec"])
    except (OSError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise DatasetError(f"{path} is missing or damaged: {error!r}.") from error
    written = spec.written_sensors
    contents = [(s.id, kind.content) for s in written if (kind := known_kind(s.kind)) is not None]
    colour = next((name for name, content in contents if content == COLOUR), "")
    camera = next((name for name, content in contents if content in CAMERAS), "")
    return EpisodeFacts(
        episode_id=episode_id,
        attempt=attempt,
        frames=frames,
        bytes=size,
        index=spec.index,
        map=spec.map,
        weather=spec.weather.preset or "own values",
        saved_fps=spec.saved_fps,
        duration_s=spec.duration_s,
        sensors=len(written),
        thumbnail=colour or camera,
    )
