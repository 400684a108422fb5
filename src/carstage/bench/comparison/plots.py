"""Plots of a comparison, each as SVG and PNG: runs as boxes, lines through their medians."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Final

from carstage.bench.comparison.figures import Measured, line, of, programs_in, values_in
from carstage.bench.comparison.presets import EXPERIMENTS, Experiment
from carstage.bench.comparison.programs import CARSTAGE, DISCARD, FPNG, NATIVE
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {
    CARSTAGE: "#1769aa",
    FPNG: "#4aa3df",
    DISCARD: "#7a8594",
    NATIVE: "#b3261e",
    "native-ply": "#b3261e",
    "native-threads": "#e07a1f",
    "native-npy": "#8a5a00",
    "paper": "#2e7d32",
}
_OTHERS: Final = ("#6a4fb3", "#c2185b", "#00838f", "#9e9d24", "#5d4037")
_LABELS: Final[dict[Experiment, str]] = {
    "frames": "frames",
    "cameras": "cameras of 1280x720",
    "lidars": "LiDARs of 100,000 points",
    "objects": "vehicles, and as many pedestrians",
}
_DPI = 120


def plot_all(out: Path, measured: Measured) -> dict[str, Path]:
    """Draw every experiment that varies something; returns the SVG of each.

    Raises:
        BadInputError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise BadInputError(
            "Plots need matplotlib.", "Install the extra: pip install 'carstage[bench]'."
        ) from error

    drawn: dict[str, Path] = {}
    for experiment in EXPERIMENTS:
        names = programs_in(measured, experiment)
        if experiment not in _LABELS or not names:
            continue
        figure = Figure(figsize=(9.0, 5.0), layout="constrained")
        axes = figure.subplots()
        _draw(axes, experiment, names, measured)
        path = out / f"{experiment}.svg"
        figure.savefig(path, metadata={"Date": None})
        figure.savefig(path.with_suffix(".png"), dpi=_DPI)
        drawn[experiment] = path
    return drawn


def _draw(axes: Axes, experiment: Experiment, names: Iterable[str], measured: Measured) -> None:
    others = iter(_OTHERS)
    for name in names:
        runs = of(measured, experiment, name)
        values = values_in(runs)
        colour = _COLOURS.get(name) or next(others)
        xs = [_frames(runs, value) for value in values] if experiment == "frames" else values
        # Programs may have recorded other numbers of frames, of which each has a share of what is
        # constant: what is comparable is a frame's share of the rest.
        fitted = line(runs)
        if fitted is None:
            continue  # one value alone does not tell the start from the rest
        begin_s = 0.0 if experiment == "frames" else fitted.begin_s
        boxes = []
        for value in values:
            share = 1.0 if experiment == "frames" else 1e3 / _frames(runs, value)
            times = [one.recorded_s - begin_s for trial, one in runs if trial.value == value]
            boxes.append([share * time_s for time_s in times])
        medians = [median(box) for box in boxes]
        axes.plot(xs, medians, color=colour, marker="o", markersize=3, label=name)
        if all(len(box) > 1 for box in boxes):
            width = 0.04 * (max(xs) - min(xs)) if len(xs) > 1 else 0.1
            axes.boxplot(
                boxes,
                positions=xs,
                widths=width,
                manage_ticks=False,
                showfliers=False,
                boxprops={"color": colour},
                whiskerprops={"color": colour},
                capprops={"color": colour},
                medianprops={"color": colour},
            )
    axes.set_xlabel(_LABELS[experiment])
    axes.locator_params(axis="x", integer=True)
    if experiment == "frames":
        axes.set_ylabel("seconds of a run")
    else:
        axes.set_ylabel("ms per frame, less the constant part")
    if experiment != "objects":
        axes.set_yscale("log")
    axes.grid(visible=True, which="both", alpha=0.25)
    if axes.has_data():
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")


def _frames(runs: Measured, value: int) -> int:
    return next(trial.frames for trial, _ in runs if trial.value == value)
