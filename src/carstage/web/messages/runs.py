"""Runs: queued, going on, ended; their log and tick times."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from carstage.web.messages.base import DatasetId, Document, Message, Name, RunId

RunState = Literal[
    "queued", "planning", "starting", "recording", "converting", "done", "failed", "interrupted"
]
Alive = Literal["queued", "running", "stalled", "dead", "ended"]
Level = Literal["debug", "info", "warning", "error"]


class RunStart(Message):
    """A run to begin, at once or after those before it.

    Attributes:
        dataset: name of the folder below the first root; made when it is missing.
        config: what to record; left out: the saved configuration.
        rev: with ``config`` left out: the revision that the user saw; another one is a conflict.
        append: record also beside episodes of other settings, versions or environments.
    """

    dataset: Name
    config: Document | None = None
    rev: int | None = None
    retries: Annotated[int, Field(ge=0, le=100)] = 2
    append: bool = False


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


class RunSensor(Message):
    """A sensor of the rig."""

    id: str
    kind: str


class RunSummary(Message):
    """One run.

    Attributes:
        alive: by process, its start time and heartbeat; ``stalled``: alive, but without heartbeat.
        position: place in the queue, from 1; 0 for what is begun.
        stop: how often it was asked to stop.
        progress: share of all ticks and frames of the run, 0 to 1.
        rate_ticks_s: simulated steps per second of wall time, lately.
        started, ended: Unix times.
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
    eta_s: float | None = None
    disk_free_bytes: int | None = None
    started: float | None = None
    ended: float | None = None
    sensors: list[RunSensor] = Field(default_factory=list)


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
        tick_s: wall seconds per step since the point before.
        queued_bytes: sensor data that wait for the disk.
        waited_s: how long ticks have waited for room, in sum.
    """

    time: float
    tick: int
    tick_s: float | None
    queued_bytes: int
    waited_s: float


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
    """A run with what a page needs to show it from the start."""

    run: RunSummary
    config: Document
    log: list[LogLine]
    ticks: list[TickPoint]
    channels: list[Channel]
