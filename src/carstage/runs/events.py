"""What happens in a run, as typed events: the lines of ``events.jsonl``, and how far the run is.

``on_event`` of ``carstage.run`` gets each of them. ``event_of`` makes one of a line, so the events
of a run that has ended, or goes on elsewhere, can be read from its folder
(docs/formats/run-folder.md).
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

from carstage.plan import RunEstimate
from carstage.runs.folder import CurrentEpisode, EpisodeCounts, State, WorkerStatus
from carstage.spec.values import Value


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunEvent(Value):
    """Base of all events.

    Attributes:
        time_s: Unix time.
    """

    time_s: float = field(default_factory=time.time, kw_only=True)

    def to_line(self) -> dict[str, Any]:
        """The content of the event's line in ``events.jsonl``."""
        line: dict[str, Any] = {"time": self.time_s, "event": _name(type(self))}
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name != "time_s" and not (value is None and entry.default is None):
                line[entry.name] = value
        return line


OnEvent = Callable[[RunEvent], object]
"""Called with each event, mostly from the thread that called ``run``. It should return soon; an
error that it raises ends the run. A ``Notice`` may come from another thread."""


# What only ``on_event`` gets.


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunPlanned(RunEvent):
    """The run is planned and fits on the disk; nothing is recorded yet.

    Attributes:
        estimate: bytes and duration of what is to be recorded.
        todo: number of episodes to record.
        skipped: number of episodes that the dataset has already.
    """

    estimate: RunEstimate
    todo: int
    skipped: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Progress(RunEvent):
    """How far the run is; comes several times a second.

    Attributes:
        state: what the run does.
        episodes: how many episodes are in which state.
        current: the episode that is recorded or converted; None between two.
        workers: what each of several workers does; empty where there is one.
        eta_s: seconds that the rest will take, as far as that is known of several workers.
    """

    state: State
    episodes: EpisodeCounts
    current: CurrentEpisode | None
    workers: tuple[WorkerStatus, ...] = ()
    eta_s: float | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Notice(RunEvent):
    """A sentence that the user should read, such as a warning about the configuration."""

    sentence: str


# Lines of events.jsonl.


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OtherEvent(RunEvent):
    """A line without a type here, such as the collector's ticks.

    Attributes:
        name: the line's ``event``, for example ``tick`` or ``segment_sealed``.
        fields: the line's other fields.
    """

    name: str
    fields: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunStarted(RunEvent):
    """The run's folder exists."""

    run_id: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunFinished(RunEvent):
    """The run has ended; nothing comes after it."""

    state: State
    committed: int
    failed: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WorkerStarted(RunEvent):
    """One of several workers is there; its server is not up yet."""

    worker: int
    host: str
    pid: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WorkerLost(RunEvent):
    """One of several workers has died; its episodes are recorded again by others."""

    worker: int
    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServerStarted(RunEvent):
    """A server is up; ``pid`` is None where we did not start it."""

    kind: str
    host: str
    port: int
    pid: int | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class GraphicsCardChecked(RunEvent):
    """On which graphics card a server runs.

    Attributes:
        wanted: the card that it was to use, as CARLA counts them.
        found: the one that ``nvidia-smi`` shows it on; None where that cannot be seen.
    """

    wanted: int
    found: int | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServerLost(RunEvent):
    """A server ended while it started, and is started once more."""

    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServerStopped(RunEvent):
    """A server was stopped; ``exit_code`` is None where it goes on without us."""

    exit_code: int | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServerTested(RunEvent):
    """The verdict of the self-test, as in the commit marker.

    Attributes:
        ok: whether every check holds.
        server: version of the server.
        client: version of the client.
        map: the map that was loaded.
        checks: the checks with ``name`` and ``ok``.
        gnss: ``projection`` and ``north`` of the server's GNSS sensors, where they are known.
    """

    ok: bool
    server: str
    client: str
    map: str
    checks: list[dict[str, Any]]
    gnss: dict[str, str] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Connected(RunEvent):
    """A collector has connected to the server."""

    server_version: str
    map: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AttemptReserved(RunEvent):
    """An attempt of an episode begins; its folder exists."""

    episode_id: str
    attempt: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeStarted(RunEvent):
    """The collector begins to record; ``ticks`` is the number of steps to come."""

    episode_id: str
    attempt: str
    ticks: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ActorsSpawned(RunEvent):
    """How many actors of each kind were asked for and are there."""

    episode_id: str
    requested: Mapping[str, int]
    spawned: Mapping[str, int]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeRecorded(RunEvent):
    """The raw recording is whole; ``incomplete`` ticks lack data of a sensor."""

    episode_id: str
    attempt: str
    ticks: int
    incomplete: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FramesConverted(RunEvent):
    """All frames of an episode are files."""

    episode_id: str
    frames: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Load(RunEvent):
    """What the run's processes take; comes every two seconds.

    Of several workers, each tells its own, and the run that of all on its machine.

    Attributes:
        cpu_cores: CPU seconds per second since the event before.
        memory_bytes: resident memory; what processes share counts for each.
        written_bytes_s: bytes per second that went to disks; None where that is not counted.
        disk_free_bytes: free space where the run writes.
    """

    cpu_cores: float
    memory_bytes: int
    written_bytes_s: int | None
    disk_free_bytes: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeCommitted(RunEvent):
    """An episode is part of the dataset."""

    episode_id: str
    attempt: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeSkipped(RunEvent):
    """An episode is in the dataset without this run; ``attempt`` is set where one was lost."""

    episode_id: str
    reason: str
    attempt: str | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeRetried(RunEvent):
    """An attempt failed; another one follows."""

    episode_id: str
    attempt: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EpisodeFailed(RunEvent):
    """An episode failed; the run goes on with the next one."""

    episode_id: str
    attempt: str
    reason: str


def _name(kind: type[RunEvent]) -> str:
    return re.sub(r"(?<!^)([A-Z])", r"_\1", kind.__name__).lower()


_WRITTEN: dict[str, type[RunEvent]] = {
    _name(kind): kind
    for kind in (
        RunStarted,
        RunFinished,
        WorkerStarted,
        WorkerLost,
        ServerStarted,
        GraphicsCardChecked,
        ServerLost,
        ServerStopped,
        ServerTested,
        Connected,
        AttemptReserved,
        EpisodeStarted,
        ActorsSpawned,
        EpisodeRecorded,
        FramesConverted,
        Load,
        EpisodeCommitted,
        EpisodeSkipped,
        EpisodeRetried,
        EpisodeFailed,
    )
}


def event_of(line: Mapping[str, Any]) -> RunEvent:
    """The event that a line of ``events.jsonl`` stands for.

    Fields that the event's type does not have are left out. A line of an unknown name, or without a
    field that its type needs, is an ``OtherEvent``.
    """
    at = float(line.get("time", 0.0))
    kind = _WRITTEN.get(line["event"], OtherEvent)
    wanted = [entry for entry in fields(kind) if entry.name != "time_s"]
    if kind is OtherEvent or any(f.name not in line and f.default is MISSING for f in wanted):
        rest = {key: value for key, value in line.items() if key not in ("time", "event")}
        return OtherEvent(line["event"], rest, time_s=at)
    return kind(**{f.name: line[f.name] for f in wanted if f.name in line}, time_s=at)


def read_events(folder: Path | str) -> list[RunEvent]:
    """The events of a run so far, from its folder ``OUT/runs/<run_id>``.

    Raises:
        OSError: there is no ``events.jsonl``.

    Example:
        >>> for event in read_events("datasets/demo/runs/20261123-155645-e45488"):
        ...     print(event)
    """
    from carstage.runs.reading import parse_event

    lines = (Path(folder) / "events.jsonl").read_bytes().split(b"\n")
    return [event_of(line) for raw in lines if (line := parse_event(raw)) is not None]
