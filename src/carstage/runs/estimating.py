"""How long a configuration takes, how large it gets and what that costs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from carstage.config import Config
from carstage.plan import EpisodePlan, estimate_run
from carstage.runs.pilot import Mean, Pilot

_REFERENCE_CORES = 2
"""Of the machine that the estimate without pilots is for."""
_AT_ONCE = 2
"""Raw recordings that are on the disk at the same time, unless all are kept."""


@dataclass(frozen=True, slots=True)
class Prices:
    """What a user pays; 0: nothing."""

    core_hour: float = 0.0
    gpu_hour: float = 0.0
    gb_month: float = 0.0


@dataclass(frozen=True, slots=True)
class CampaignEstimate:
    """What the whole configuration will need.

    Attributes:
        basis: ``pilot`` or ``table``: measured, or reckoned by the figures of a 2-core machine.
        episodes, frames: to record.
        workers: servers that work at the same time.
        hours: wall time with that many workers.
        core_hours: CPU time of all processes.
        dataset_bytes: of the dataset.
        peak_bytes: the most that is on the disk at once, raw recordings among it.
        money: of core, GPU and a month of storage; empty without prices.
        error: by figure, two standard errors over it; empty where nothing tells.
        notes: what to know.
    """

    basis: str
    episodes: int
    frames: int
    workers: int
    hours: float
    core_hours: float
    dataset_bytes: int
    peak_bytes: int
    money: dict[str, float]
    error: dict[str, float]
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return asdict(self)


def estimate_by_table(
    config: Config, plan: EpisodePlan, *, workers: int = 1, prices: Prices = Prices()
) -> CampaignEstimate:
    """The estimate without recording anything: sizes on the safe side, times roughly.

    Args:
        config: the configuration.
        plan: its episodes.
        workers: servers that work at the same time.
        prices: what a user pays.
    """
    whole = estimate_run(config, plan)
    hours = whole.duration_s / 3600.0
    notes = (
        "Times are those of a machine with 2 cores and the embedded simulator.",
        *_notes(config),
    )
    return CampaignEstimate(
        basis="table",
        episodes=len(plan),
        frames=plan.frames,
        workers=workers,
        hours=hours / workers,
        core_hours=hours * _REFERENCE_CORES,
        dataset_bytes=whole.dataset_bytes,
        peak_bytes=whole.peak_bytes,
        money=_money(prices, hours, hours * _REFERENCE_CORES, whole.dataset_bytes),
        error={},
        notes=notes,
    )


def estimate_by_pilots(
    config: Config,
    plan: EpisodePlan,
    pilots: Sequence[Pilot],
    *,
    workers: int = 1,
    prices: Prices = Prices(),
    cores: int | None = None,
) -> CampaignEstimate:
    """The estimate from pilots: what an episode and what a frame took, times how many there are.

    Args:
        config: the configuration.
        plan: its episodes.
        pilots: at least one.
        workers: servers that work at the same time, each on cores like those of the pilots.
        prices: what a user pays.
        cores: of this machine; default: those that this process may use.
    """
    cores = cores or len(os.sched_getaffinity(0))
    episodes, frames = len(plan), plan.frames

    def total(begin: Sequence[float], per_frame: Sequence[float]) -> Mean:
        """A sum over the plan, as each of the pilots would have it."""
        pairs = zip(begin, per_frame, strict=True)
        return Mean.of([episodes * one + frames * each for one, each in pairs])

    cpu_s = total(
        [pilot.begin_cpu_s for pilot in pilots],
        [pilot.frames_cpu_s / pilot.frames for pilot in pilots],
    )
    wall_s = total(
        [pilot.begin_wall_s for pilot in pilots],
        [pilot.frames_wall_s / pilot.frames for pilot in pilots],
    )
    none = [0.0] * len(pilots)
    size = total(none, [pilot.dataset_bytes / pilot.frames for pilot in pilots])
    raw = Mean.of([pilot.raw_bytes / pilot.frames for pilot in pilots])
    worker_s = max(wall_s.value, cpu_s.value / cores)  # conversion goes on beside recording
    each = np.sort(plan.costs["frames"])
    all_kept = config.output.keep_raw or config.conversion.mode == "deferred"
    at_once = int(each.sum() if all_kept else each[-_AT_ONCE:].sum())
    sums = {"core_hours": cpu_s, "hours": wall_s, "dataset_bytes": size}
    notes = [f"From {len(pilots)} short episodes on {cores} cores of this machine."]
    if len(pilots) < 2:
        notes.append("One pilot tells no spread: more of them say how sure the figures are.")
    return CampaignEstimate(
        basis="pilot",
        episodes=episodes,
        frames=frames,
        workers=workers,
        hours=worker_s / 3600.0 / workers,
        core_hours=cpu_s.value / 3600.0,
        dataset_bytes=round(size.value),
        peak_bytes=round(size.value + raw.value * at_once),
        money=_money(prices, worker_s / 3600.0, cpu_s.value / 3600.0, size.value),
        error={name: one.error for name, one in sums.items() if one.error is not None},
        notes=(*notes, *_notes(config)),
    )


def _money(
    prices: Prices, hours: float, core_hours: float, dataset_bytes: float
) -> dict[str, float]:
    """By what is paid for; storage for a month."""
    parts = {
        "cores": prices.core_hour * core_hours,
        "gpus": prices.gpu_hour * hours,
        "storage_month": prices.gb_month * dataset_bytes / 1e9,
    }
    paid = {name: amount for name, amount in parts.items() if amount}
    return {**paid, "total": sum(paid.values())} if paid else {}


def _notes(config: Config) -> tuple[str, ...]:
    quotas = config.campaign is not None and config.campaign.quotas
    return ("Quotas may end it sooner.",) if quotas else ()
