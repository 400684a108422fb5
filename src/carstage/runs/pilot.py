"""What a campaign will cost, measured: a few short episodes of it are recorded and thrown away."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from carstage.config import Config, check_config, dump_config
from carstage.errors import CarStageError
from carstage.plan import Sampling
from carstage.runs.events import (
    AttemptReserved,
    EpisodeCommitted,
    EpisodeRecorded,
    Notice,
    OtherEvent,
    RunEvent,
)
from carstage.runs.running import run
from carstage.storage import open_store

PILOT_S = 3.0
"""Simulated seconds of a pilot episode, at most."""
_FIRST_S = 3.0
"""Of the episode before it, in which each converter compiles or loads what it needs."""
_RETRIES = 1
_PHASES = frozenset(("began", "stepped", "recorded", "committed"))


class PilotError(CarStageError):
    """A pilot episode could not be recorded, so nothing is known of the others."""


@dataclass(frozen=True, slots=True)
class Pilot:
    """What one short episode took, once the server was up.

    Attributes:
        index: its number among those planned, from 0.
        frames: saved frames.
        begin_cpu_s, begin_wall_s: until the first recorded step: loading, spawning, warm-up.
        frames_cpu_s: from there to the commit, of all processes of the run.
        frames_wall_s: from there to the last recorded step.
        dataset_bytes: of its files.
        raw_bytes: of its raw log.
    """

    index: int
    frames: int
    begin_cpu_s: float
    begin_wall_s: float
    frames_cpu_s: float
    frames_wall_s: float
    dataset_bytes: int
    raw_bytes: int


def record_pilots(
    config: Config,
    count: int,
    notice: Callable[[str], None] = lambda sentence: None,
    *,
    longest_s: float = PILOT_S,
) -> list[Pilot]:
    """Record some episodes of a configuration, shortened, into a folder that is then removed.

    They are spread evenly over the configuration, and its variants take turns. Each has a server of
    its own, so that what one leaves to be done does not count as the next one's. Another episode
    goes before it: what a server and the converters do once in their life is not the pilot's.

    Args:
        config: the configuration.
        count: how many, at most as many as it has episodes in all variants.
        notice: told of what goes on.
        longest_s: simulated seconds of a pilot, at most.

    Raises:
        BadInputError: something in the configuration cannot be; nothing was started.
        PilotError: a pilot failed.
        CarStageError: the server does not start, or the disk is full.
        KeyboardInterrupt: the user ended it.
    """
    sampling = Sampling(config)
    names = tuple(config.variants)
    count = min(count, config.planned_episodes)
    pilots = []
    for number in range(count):
        episode = (2 * number + 1) * config.episodes // (2 * count)
        asked, variant = sampling.config(episode), names[number % len(names)] if names else None
        if variant is not None:
            asked = asked.as_variant(variant)
        index = config.number_of(episode, variant)
        notice(f"Pilot {number + 1} of {count}: episode {index + 1}, shortened.")
        short = shortened(asked, longest_s)
        with tempfile.TemporaryDirectory(prefix="carstage-pilot-") as folder:
            pilots.append(_record(short, Path(folder) / "pilot", index, notice))
    return pilots


def shortened(config: Config, longest_s: float = PILOT_S) -> Config:
    """Two short episodes like one of a configuration: the first warms server and converters up.

    Args:
        config: the configuration of one episode.
        longest_s: simulated seconds of the second one, at most.
    """
    document = dump_config(config)
    durations_s = [min(config.duration_s, most_s) for most_s in (_FIRST_S, longest_s)]
    sensors = {sensor.id for _, sensor in config.sensors_of_all_variants()}
    codecs = document["conversion"]["codecs"]
    document["conversion"]["codecs"] = {k: codec for k, codec in codecs.items() if k in sensors}
    document["output"]["keep_raw"] = False
    document["episodes"] = 2
    document["campaign"] = {"method": "grid", "sample": {"duration_s": {"choice": durations_s}}}
    return check_config(document)


def _record(config: Config, out: Path, index: int, notice: Callable[[str], None]) -> Pilot:
    clock = _PhaseClock(notice)
    ended = run(config, out, clock, retries=_RETRIES)
    if ended.state == "interrupted":
        raise KeyboardInterrupt
    if ended.failures or not clock.times.keys() >= _PHASES:
        reason = next(iter(ended.failures.values()), "it was not recorded.")
        raise PilotError(f"Pilot episode {index + 1} failed: {reason}", "Record it by itself.")
    began, stepped = clock.times["began"], clock.times["stepped"]
    recorded, committed = clock.times["recorded"], clock.times["committed"]
    marker = open_store(out).committed()[clock.episode_id]
    return Pilot(
        index=index,
        frames=marker.frames,
        begin_cpu_s=stepped.cpu_s - began.cpu_s,
        begin_wall_s=stepped.wall_s - began.wall_s,
        frames_cpu_s=committed.cpu_s - stepped.cpu_s,
        frames_wall_s=recorded.wall_s - stepped.wall_s,
        dataset_bytes=sum(entry.bytes for entry in marker.files),
        raw_bytes=clock.raw_bytes,
    )


@dataclass(frozen=True, slots=True)
class _Moment:
    """Seconds of CPU and of the wall at an event."""

    cpu_s: float
    wall_s: float


@dataclass(slots=True)
class _PhaseClock:
    """Hears of a run's events, and remembers when the phases of its last episode began."""

    notice: Callable[[str], None]
    episode_id: str = ""
    times: dict[str, _Moment] = field(default_factory=dict)
    raw_bytes: int = 0

    def __call__(self, event: RunEvent) -> None:
        if isinstance(event, Notice):
            self.notice(event.sentence)
        elif isinstance(event, AttemptReserved):
            self.episode_id, self.raw_bytes = event.episode_id, 0
            self.times.clear()
            self._mark("began")
        elif isinstance(event, EpisodeRecorded):
            self._mark("recorded")
        elif isinstance(event, EpisodeCommitted):
            if event.episode_id == self.episode_id:
                self._mark("committed")
        elif isinstance(event, OtherEvent) and event.fields.get("episode_id") == self.episode_id:
            if event.name == "tick" and "stepped" not in self.times:
                self._mark("stepped")
            elif event.name == "segment_sealed":
                self.raw_bytes += int(event.fields["bytes"])

    def _mark(self, phase: str) -> None:
        self.times[phase] = _Moment(tree_cpu_s(), time.perf_counter())


def tree_cpu_s() -> float:
    """CPU seconds of this process and all that it started, those that have ended among them."""
    own = os.times()
    total = own.user + own.system + own.children_user + own.children_system
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has ended meanwhile, and its parent has its times
            times = child.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return float(total)


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean of pilots, and how sure it is.

    Attributes:
        value: the mean.
        error: two standard errors, relative to it; None: one pilot tells no spread.
    """

    value: float
    error: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Mean:
        """The mean of some values, one at least."""
        mean = statistics.fmean(values)
        if len(values) < 2 or mean == 0.0:
            return cls(mean, None)
        return cls(mean, 2.0 * statistics.stdev(values) / len(values) ** 0.5 / mean)
