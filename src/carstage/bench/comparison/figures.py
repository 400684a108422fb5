"""From runs to figures: medians, spreads, and lines through them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np

from carstage.bench.comparison.presets import Experiment
from carstage.bench.comparison.trials import Trial, TrialResult

_STUDENT: Final = {
    1: 6.314, 2: 2.920, 3: 2.353, 4: 2.132, 5: 2.015, 6: 1.943, 7: 1.895, 8: 1.860, 9: 1.833,
    10: 1.812, 15: 1.753, 20: 1.725, 30: 1.697, 60: 1.671, 120: 1.658,
}  # fmt: skip
"""The quantile 0.95 of Student's t distribution, by the degrees of freedom."""
_FEW_PAIRS = 6
_MEDIAN_APART_OF_SD = 0.9539
"""The median of how far two draws from a normal distribution are apart, of its deviation."""
_OF_A_MEDIAN = math.pi / 2.0
"""The variance of a median of many such draws, of that of their mean; of few it is smaller."""

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
        error_s: ``per_unit_s`` is not further off to one side, with 95 % confidence; NaN where the
            runs are too few to tell.
    """

    per_unit_s: float
    begin_s: float
    r2: float
    values: int
    error_s: float

    @property
    def is_measurable(self) -> bool:
        """Whether a unit takes more than chance alone would show; one run of each cannot tell."""
        if math.isnan(self.error_s):
            return self.per_unit_s > 0.0
        return self.per_unit_s > self.error_s

    @property
    def least_s(self) -> float:
        """A unit takes no less; 0 where that is all that is known."""
        return 0.0 if math.isnan(self.error_s) else max(0.0, self.per_unit_s - self.error_s)

    @property
    def most_s(self) -> float:
        """A unit takes no more; NaN where the runs are too few to tell."""
        return max(0.0, self.per_unit_s) + self.error_s


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
    error_s = _error_of_slope(points, xs, rest)
    return Line(float(slope) * per, float(begin), r2, len(xs), error_s * per)


def _error_of_slope(
    points: Sequence[tuple[float, float]], xs: Sequence[float], rest: float
) -> float:
    """How far a slope through medians may be off, at 95 %; NaN where nothing tells it.

    The spread of the runs at each value and how far the medians lie from the line both tell the
    variance of a median, each with its degrees of freedom. Of many runs, single ones that were held
    up do not count.

    Args:
        points: value and seconds of all runs.
        xs: the values.
        rest: sum of the squares by which the medians miss the line.
    """
    runs = [[y for x, y in points if x == at] for at in xs]
    square = float(np.sum((np.array(xs) - np.mean(xs)) ** 2))
    off_line = len(xs) - 2
    at_values = sum(len(ys) - 1 for ys in runs)
    if off_line + at_values == 0:
        return float("nan")
    sd = _deviation([abs(a - b) for ys in runs for a, b in combinations(ys, 2)])
    of_medians = float(np.mean([(1.0 if len(ys) < 3 else _OF_A_MEDIAN) / len(ys) for ys in runs]))
    freedom = off_line + at_values
    variance = (at_values * sd**2 * of_medians + rest) / freedom
    return _student(freedom) * math.sqrt(variance / square)


def _deviation(apart: Sequence[float]) -> float:
    """The standard deviation of runs, by how far pairs of them are apart; 0 without any."""
    if len(apart) >= _FEW_PAIRS:
        return _median(apart) / _MEDIAN_APART_OF_SD
    return math.sqrt(float(np.mean(np.square(apart))) / 2.0) if apart else 0.0


def _student(freedom: int) -> float:
    """The quantile of as many degrees of freedom, or of fewer where those are not listed."""
    return _STUDENT[max(known for known in _STUDENT if known <= freedom)]


def _x(trial: Trial, result: TrialResult) -> float:
    if trial.experiment == "frames":
        return float(trial.frames)
    return float(result.spawned) if trial.experiment == "objects" else float(trial.value)


def _median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))
