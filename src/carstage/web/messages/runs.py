"""Runs: queued, going on, ended; their log and tick times."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from carstage.execution.slots import MOST_WORKERS
from carstage.web.messages.base import DatasetId, Document, Label, Message, Name, Place, RunId

RunState = Literal[
    "queued", "planning", "starting", "recording", "converting", "done", "failed", "interrupted"
]
Alive = Literal["queued", "running", "stalled", "dead", "ended"]
MOST_COMPARED = 6
"""So many runs at once: their curves have to be told apart."""
Level = Literal["debug", "info", "warning", "error"]
Workers = Annotated[int, Field(ge=1, le=MOST_WORKERS)] | Literal["auto"]


class RunStart(Message):
    """A run to begin, at once or after those before it.

    Attributes:
        dataset: name of the folder below the first root, made when it is missing, or an address of
            an object store.
        config: what to record; left out: the saved configuration.
        rev: with ``config`` left out: the revision that the user saw; another one is a conflict.
        append: record also beside episodes of other settings, versions or environments.
        workers: servers on this machine, each recording an episode.
        catalog: a catalog that the run writes to as well; an address without a password.
        work: folder of this machine for raw recordings and logs; left out: the dataset's own, or
            one in the user's cache.
    """

    dataset: Place
    config: Document | None = None
    rev: int | None = None
    retries: Annotated[int, Field(ge=0, le=100)] = 2
    append: bool = False
    workers: Workers = 1
    catalog: Annotated[str, Field(max_length=1000)] | None = None
    work: Annotated[str, Field(max_length=1000)] | None = None


class RunAgain(Message):
    """The same run once more.

    Attributes:
        dataset: another place, for a run of its own; left out: go on in its dataset with what is
            missing there.
    """

    dataset: Place | None = None


class RunStop(Message):
    """A wish that a run ends.

    Attributes:
        seen: ``stop`` of the run as the user saw it; when it was asked to stop since then, nothing
            is done. Left out: what is asked for is meant.
    """

    seen: int | None = None


class RunChange(Message):
    """A new name for a run."""

    name: Label


class EpisodeCountsMessage(Message):
    """How many episodes are in which state."""

    total: int = 0
    committed: int = 0
    failed: int = 0
    skipped: int = 0


class CurrentEpisodeMessage(Message):
    """The episode that is being recorded or converted."""

    episode_id: str
    index: int
    attempt: str
    ticks_done: int = 0
    ticks_total: int = 0
    frames_converted: int = 0
    frames_total: int = 0


class WorkerMessage(Message):
    """What one of several workers does."""

    worker: int
    state: str
    current: CurrentEpisodeMessage | None = None


class RunSensor(Message):
    """A sensor of the rig."""

    id: str
    kind: str


class DrivenAtPage(Message):
    """Who drives a run's ego at the page.

    Attributes:
        device: what is driven with.
        camera: sensor whose pictures the driver sees.
        inputs: numbers of the device's axes and buttons, by what they do; none of a keyboard.
    """

    device: Literal["keyboard", "gamepad", "wheel"]
    camera: str
    inputs: dict[str, int]


class RunSummary(Message):
    """One run.

    Attributes:
        alive: by process, its start time and heartbeat; ``stalled``: alive, but without heartbeat.
        position: place in the queue, from 1; 0 for what is begun.
        stop: how often it was asked to stop.
        progress: share of all ticks and frames of the run, 0 to 1.
        rate_ticks_s: simulated steps per second of wall time, lately.
        mean_ticks_s: the same over the whole run, of one that has ended.
        started, ended: Unix times.
        location: folder or address of its dataset.
        folder: the run's own folder; None: it has made none.
        continues: the run that this one goes on with.
        resumable: it has ended, and something of it is missing that the same command would record.
        again: why the episode under way is recorded once more; None: it is its first attempt.
        workers: each of several workers; empty where there is one.
        driven: how its ego is driven at the page; None: otherwise.
    """

    run_id: RunId
    dataset: DatasetId
    name: str
    state: RunState
    alive: Alive
    position: int = 0
    stop: int = 0
    episodes: EpisodeCountsMessage
    current: CurrentEpisodeMessage | None = None
    message: str | None = None
    progress: float = 0.0
    rate_ticks_s: float | None = None
    mean_ticks_s: float | None = None
    eta_s: float | None = None
    disk_free_bytes: int | None = None
    started: float | None = None
    ended: float | None = None
    sensors: list[RunSensor] = Field(default_factory=list)
    location: str = ""
    folder: str | None = None
    continues: str | None = None
    resumable: bool = False
    again: str | None = None
    workers: list[WorkerMessage] = Field(default_factory=list)
    driven: DrivenAtPage | None = None


class RunList(Message):
    """All runs of all datasets, newest first, queued ones before."""

    runs: list[RunSummary]


class LogLine(Message):
    """One line of a run's log, in words."""

    time: float
    level: Level
    event: str
    text: str


class TickPoint(Message):
    """The numbers of a tick event.

    Attributes:
        tick_s: wall seconds per step since the point before of this worker.
        frames_s: saved frames per second since this worker told the rate before; None between.
        queued_bytes: sensor data that wait for the disk.
        waited_s: how long ticks have waited for room, in sum.
        worker: which of several workers it is of; 0: there is one.
    """

    time: float
    tick: int
    tick_s: float | None
    frames_s: float | None = None
    queued_bytes: int
    waited_s: float
    worker: int = 0


class LoadPoint(Message):
    """What the processes of a run took of the machine, see ``carstage.runs.events.Load``.

    Attributes:
        worker: whose processes; 0: all of the run on its machine.
    """

    time: float
    worker: int = 0
    cpu_cores: float
    memory_bytes: int
    written_bytes_s: int | None = None
    disk_free_bytes: int


class Channel(Message):
    """What one channel of the binary previews holds.

    Attributes:
        kind: ``image``: JPEG; ``points``: float32 x, y, z, intensity in the sensor's axes;
            ``radar``: float32 x, y, z, range rate.
    """

    channel: int
    sensor_id: str
    kind: Literal["image", "points", "radar"]


class RunDetail(Message):
    """A run with what a page needs to show it from the start.

    Attributes:
        committed: ids of the episodes that it has committed itself, in their order.
        bytes: what its own folder takes: logs, and raw recordings where they are kept.
    """

    run: RunSummary
    config: Document
    log: list[LogLine]
    ticks: list[TickPoint]
    loads: list[LoadPoint] = Field(default_factory=list)
    channels: list[Channel]
    committed: list[Name] = Field(default_factory=list)
    bytes: int = 0


class RunFiguresMessage(Message):
    """What a run took, see ``carstage.runs.comparing.RunFigures``."""

    run_id: RunId
    name: str
    state: str
    took_s: float | None
    episodes: int
    planned: int
    failed: int
    frames: int
    frames_s: float | None
    cpu_cores: float | None
    memory_bytes: int | None
    written_bytes: int | None


class ComparedRun(Message):
    """One of several runs.

    Attributes:
        figures: None where it has made no folder.
    """

    run: RunSummary
    figures: RunFiguresMessage | None = None
    ticks: list[TickPoint] = Field(default_factory=list)
    loads: list[LoadPoint] = Field(default_factory=list)


class SettingDifference(Message):
    """A setting that is not the same in all of several runs.

    Attributes:
        title: as the form has it; empty where that has none.
        values: one for each run, in their order; None where it has none.
    """

    path: str
    title: str
    values: list[Any]


class RunComparison(Message):
    """Several runs beside each other.

    Attributes:
        settings: those that differ; those of runs without a configuration are not compared.
        note: why settings are not compared; empty where they are.
    """

    runs: list[ComparedRun]
    settings: list[SettingDifference]
    note: str = ""
