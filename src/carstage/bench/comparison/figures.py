"""From runs to figures: medians, spreads, and lines through them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from carstage.bench.comparison.presets import Experiment
from carstage.bench.comparison.trials import Trial, TrialResult

Measured = Sequence[tuple[Trial, TrialResult]]
Quantity = Literal["recorded_s", "cpu_s"]


@dataclass(frozen=True, slots=True)
class Spread:
    """Seconds of the runs of one program at one value; ``sd_s`` is NaN for a single run."""

    runs: int
    median_s: float
    iqr_s: float
    mean_s: float
    sd_s: float
    cpu_s: float
    server_cpu_s: float
    peak_mb: float


@dataclass(frozen=True, slots=True)
class Line:
    """Least squares through the medians of one program's runs.

    A single run that met a busy disk, which may hold it for seconds, does not turn it.

    Attributes:
        per_unit_s: seconds per frame (``frames``), or added by a sensor (or an actor) to a frame.
        begin_s: seconds at value 0.
        r2: coefficient of determination; 1 is a line.
        values: how many values there are; with two, ``r2`` means nothing.
    """

    per_unit_s: float
    begin_s: float
    r2: float
    values: int


def of(measured: Measured, experiment: Experiment, program: str) -> Measured:
    """The runs of one program in one experiment."""
    return [
        (trial, result)
        for trial, result in measured
        if (trial.experiment, trial.program) == (experiment, program)
    ]


def programs_in(measured: Measured, experiment: Experiment) -> list[str]:
    """Programs that have runs in an experiment, in the order of their first."""
    return list(dict.fromkeys(t.program for t, _ in measured if t.experiment == experiment))


def values_in(runs: Measured) -> list[int]:
    """Values that have runs."""
    return sorted({trial.value for trial, _ in runs})


def spread(runs: Measured, value: int) -> Spread:
    """The runs at one value."""
    results = [result for trial, result in runs if trial.value == value]
    walls = np.array([result.wall_s for result in results])
    low, median, high = np.percentile(walls, (25, 50, 75))
    return Spread(
        runs=len(results),
        median_s=float(median),
        iqr_s=float(high - low),
        mean_s=float(walls.mean()),
        sd_s=float(walls.std(ddof=1)) if len(walls) > 1 else float("nan"),
        cpu_s=_median(result.cpu_s for result in results),
        server_cpu_s=_median(result.server_cpu_s for result in results),
        peak_mb=max(result.peak_mb for result in results),
    )


def line(runs: Measured, quantity: Quantity = "recorded_s") -> Line | None:
    """The line of seconds over what the experiment varies; None with fewer than two values.

    In ``frames`` its slope is seconds per frame; elsewhere the slope is divided by the frames of
    the runs, so that programs with other numbers of frames can be compared. In ``objects`` the
    value is the actors that found a place.
    """
    points = [(_x(trial, result), float(getattr(result, quantity))) for trial, result in runs]
    xs = sorted({x for x, _ in points})
    if len(xs) < 2:
        return None
    medians = [_median(y for x, y in points if x == at) for at in xs]
    slope, begin = np.polyfit(xs, medians, 1)
    fitted = np.polyval((slope, begin), xs)
    spread_of_all = float(np.sum((np.array(medians) - np.mean(medians)) ** 2))
    rest = float(np.sum((np.array(medians) - fitted) ** 2))
    trial = runs[0][0]
    per = 1.0 if trial.experiment == "frames" else 1.0 / trial.frames
    r2 = 1.0 - rest / spread_of_all if spread_of_all > 0.0 else float("nan")
    return Line(float(slope) * per, float(begin), r2, len(xs))


def _x(trial: Trial, result: TrialResult) -> float:
    if trial.experiment == "frames":
        return float(trial.frames)
    return float(result.spawned) if trial.experiment == "objects" else float(trial.value)


def _median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))
