"""Every promised file is there, with the bytes that were committed, and no other file."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import TypedDict

from carstage.birds_eye import birds_eye_name
from carstage.dataset.reading import Episode
from carstage.dataset.tables import row_sensor
from carstage.files.bounded import read_bounded
from carstage.files.hashing import hash_of
from carstage.occupancy import occupancy_name
from carstage.plan.stereo import disparity_name
from carstage.storage import DatasetPath, RemotePath
from carstage.storage.fetching import fetched_ahead
from carstage.storage.names import agent_folder
from carstage.storage.remote_files import remote_files
from carstage.validation.checks.findings import Findings

DOCUMENTS = ("episode.json", "calibration.json")
TABLES = (
    "frames.parquet",
    "objects.parquet",
    "camera_objects.parquet",
    "ego.parquet",
    "sensor_poses.parquet",
)


EVENTS = "events.parquet"
CONTROLS = "controls.parquet"
LANE_LINES = "lane_lines.parquet"
PATCHES = "patches.parquet"


def tables_of(episode: Episode) -> tuple[str, ...]:
    """The tables that an episode has."""
    spec = episode.spec
    optional = {
        EVENTS: bool(spec.scenario.planned_events()),
        CONTROLS: spec.ego.driver is not None,
        LANE_LINES: spec.labels.lane_lines,
        PATCHES: bool(spec.patches),
    }
    return (*TABLES, *(table for table, is_there in optional.items() if is_there))


class _Place(TypedDict, total=False):
    sensor: str
    frame: int


@dataclass(frozen=True, slots=True)
class FileRead:
    """A file as it was read: its content, if it could be, and what is wrong (check, message)."""

    content: bytes | None = None
    problem: tuple[str, str] | None = None


@dataclass(frozen=True, slots=True)
class Listing:
    """The files below a folder.

    Attributes:
        names: paths of the regular files.
        sizes: in bytes, of those of an object store, which tells both at once.
    """

    names: frozenset[str]
    sizes: Mapping[str, int]


def list_files(folder: DatasetPath) -> Listing:
    """The files below a folder."""
    if not isinstance(folder, RemotePath):
        return Listing(_present(folder), {})
    prefix = f"{folder.key}/"
    found = remote_files(folder.root).below(folder.key)
    sizes = {one.key.removeprefix(prefix): one.bytes for one in found}
    return Listing(frozenset(sizes), sizes)


class VerifiedFiles:
    """Reads an episode's files and compares each with the marker on the way.

    Args:
        episode: the episode.
        listing: what lies in its folder.
        findings: where differences go: checks ``file_missing``, ``file_size``, ``file_hash``.
    """

    def __init__(self, episode: Episode, listing: Listing, findings: Findings) -> None:
        self._folder = episode.folder
        self._findings = findings
        self._entries = {entry.path: entry for entry in episode.files}
        self._missing = frozenset(self._entries) - listing.names
        self._sizes = listing.sizes
        self.files = 0
        self.bytes = 0

    def report_missing(self) -> None:
        """Name the files of the marker that are not there, whatever else goes wrong later."""
        for name in self._entries:
            if name in self._missing:
                message = f"{name} is missing, or no regular file"
                self._findings.add("file_missing", message, **_place_of(name))

    def read(
        self, name: str, *, frame: int | None = None, sensor: str | None = None
    ) -> bytes | None:
        """The content of a file, by its path below the episode; ``None``: it cannot be read."""
        return self.accept(self.look_at(name), frame=frame, sensor=sensor)

    def look_at(self, name: str) -> FileRead:
        """Read a file and compare it with the marker, and tell nobody; any thread may."""
        path = self._folder / name
        if name in self._missing:
            return FileRead()
        try:
            found, entry = self._size(name), self._entries.get(name)
            if entry is not None and found != entry.bytes:
                # Not read: a wrong size says enough, and may be huge.
                differs = f"{name} has {found} bytes, committed were {entry.bytes}"
                return FileRead(problem=("file_size", differs))
            content = read_bounded(path)
        except FileNotFoundError:
            return FileRead(problem=("file_missing", f"{name} is missing"))
        except OSError as error:
            problem = "file_missing", f"{name} cannot be read: {error.strerror}"
            return FileRead(problem=problem)
        return FileRead(content, self._difference(name, content))

    def accept(
        self, found: FileRead, *, frame: int | None = None, sensor: str | None = None
    ) -> bytes | None:
        """Count what :meth:`look_at` read, report what is wrong with it, and give its content."""
        if found.content is not None:
            self.files += 1
            self.bytes += len(found.content)
        if found.problem is not None:
            self._findings.add(*found.problem, frame=frame, sensor=sensor)
        return found.content

    def fetched_ahead(self, frames: Container[int] = ()) -> AbstractContextManager[None]:
        """A stretch in which files of an object store are fetched before they are read.

        Args:
            frames: whose files; without any, those that belong to no frame.
        """
        wanted = [name for name in self._entries if _frame_of(name) in (frames or (None,))]
        names = sorted(wanted, key=lambda name: name.rpartition("/")[2])  # frame by frame
        return fetched_ahead([(self._folder / name, self._entries[name].bytes) for name in names])

    def _size(self, name: str) -> int:
        known = self._sizes.get(name)
        return (self._folder / name).stat().st_size if known is None else known

    def _difference(self, name: str, content: bytes) -> tuple[str, str] | None:
        entry = self._entries.get(name)
        if entry is None:
            return None  # check_file_list reports it
        if hash_of(content, entry.hash) != entry.hash:
            return "file_hash", f"{name} is not the file that was committed: its hash differs"
        return None


def _present(folder: DatasetPath) -> frozenset[str]:
    """Paths of the regular files below a folder."""
    if isinstance(folder, RemotePath):
        return frozenset(p.relative_to(folder).as_posix() for p in folder.rglob("*"))
    found = (p for p in folder.rglob("*") if p.is_file())
    return frozenset(p.relative_to(folder).as_posix() for p in found)


def _place_of(name: str) -> _Place:
    """Sensor and frame that a file below ``sensors`` is of."""
    parts = PurePosixPath(name).parts
    if parts[0] != "sensors" or len(parts) < 2:
        return {}
    frame = parts[-1].split(".", 1)[0]
    if len(parts) == 2:
        return {"sensor": frame}
    return {"sensor": parts[1], "frame": int(frame)} if frame.isdecimal() else {"sensor": parts[1]}


def _frame_of(name: str) -> int | None:
    """The frame that a file is of, by its name."""
    stem = PurePosixPath(name).name.split(".", 1)[0]
    return int(stem) if "/" in name and stem.isdecimal() else None


def label_files(episode: Episode) -> dict[str, int]:
    """The files of labels that the spec promises, each with the frame that it is of."""
    labels, frames = episode.spec.labels, range(episode.frames)
    found: dict[str, int] = {}
    if labels.birds_eye is not None:
        found |= {birds_eye_name(k): k for k in frames}
    if labels.occupancy is not None:
        found |= {occupancy_name(k): k for k in frames}
    if labels.disparity:
        cameras = (one.id for pair in episode.stereo_pairs() for one in (pair.left, pair.right))
        found |= {disparity_name(one, k): k for one in cameras for k in frames}
    return found


def check_file_list(
    episode: Episode, recorded: Mapping[str, Iterable[int]], findings: Findings
) -> None:
    """Compare what the spec promises, what the marker lists and what the folder holds.

    Args:
        episode: the episode.
        recorded: by sensor, the frames that the ledger says there is data of.
        findings: checks ``file_unlisted`` and ``file_unexpected``.
    """
    listed = {entry.path for entry in episode.files}
    promised = {*tables_of(episode), *DOCUMENTS}
    promised.update(label_files(episode))
    for sensor in episode.sensors:
        if row_sensor(sensor.kind):
            promised.add(f"sensors/{sensor.id}.parquet")
            continue
        for k in recorded[sensor.id]:
            promised.update(sensor.file_names(k))
    of_agents = tuple(f"{agent_folder(name)}/" for name in episode.agents)
    present = {name for name in _present(episode.folder) if not name.startswith(of_agents)}
    for name in sorted(promised - listed):
        findings.add("file_unlisted", f"{name} is promised by the spec, but was not committed")
    for name in sorted(listed - promised):
        findings.add("file_unexpected", f"{name} was committed, but nothing promises it")
    for name in sorted(present - listed - promised):
        findings.add(
            "file_unexpected",
            f"{name} lies in the folder, but was not committed",
            severity="warning",
        )
