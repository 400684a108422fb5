"""What a comparison shows: ratios with their targets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from carstage.bench.comparison.figures import (
    Line,
    Measured,
    Quantity,
    line,
    of,
    programs_in,
    spread,
    values_in,
)
from carstage.bench.comparison.presets import EXPERIMENTS, QUICK, Experiment, Preset
from carstage.bench.comparison.programs import CARSTAGE, DISCARD, FPNG, NATIVE, NUMPY, PROGRAMS
from carstage.bench.verdict import Figure, Verdict
from carstage.spec.defaults import RAW_QUEUE_MB

_Target = tuple[str, str, float | None, float | None]
RATIO_TARGETS: Final[Mapping[Experiment, tuple[_Target, ...]]] = {
    "frames": ((NATIVE, CARSTAGE, 15.0, 15.0),),
    "cameras": (
        (NATIVE, CARSTAGE, 60.0, 600.0),
        (NATIVE, FPNG, 45.0, 45.0),
        ("native-threads", CARSTAGE, 30.0, 45.0),
        ("paper", CARSTAGE, 4.0, 8.0),
        ("paper-own-png", CARSTAGE, None, None),
        ("pillow", CARSTAGE, None, None),
        ("native-tiff", CARSTAGE, None, None),
        ("native-jpg", CARSTAGE, None, None),
    ),
    "lidars": (("native-ply", CARSTAGE, 60.0, 350.0), (NUMPY, CARSTAGE, 1.2, 3.0)),
    "objects": ((NATIVE, CARSTAGE, 8.0, 8.0),),
}
"""Slower program, faster program, least ratio of the added times; the last with 16 cores."""
TARGET_RUN_OF_MANY_CORES, TARGET_LIDAR_CPU_OF_MANY_CORES = 1.25, 2.0
"""Of a run of cameras, of the limit's time; of one LiDAR's run, of ``numpy.save``'s CPU time."""
TARGET_TOTAL, TARGET_TOTAL_OF_MANY_CORES = 1.15, 1.05
"""Of the whole time, as a multiple of the limit; the second with a card and 16 cores."""
_MANY_CORES = 16
TARGET_R2 = 0.99
TARGET_GROWTH = 1.1
_TICK_SHARE = 1.1
"""Memory for sensor data as a multiple of ``output.raw_queue_mb``: a tick's data come on top."""
_BOX_TOLERANCE_PX = 0.05
_QUANTITIES: Final[Mapping[Quantity, str]] = {"recorded_s": "", "cpu_s": ", CPU time"}
_UNITS: Final[Mapping[Experiment, str]] = {
    "frames": "per frame",
    "cameras": "per added camera and frame",
    "lidars": "per added LiDAR and frame",
    "objects": "per added 100 actors and frame",
}


def judge(preset: Preset, measured: Measured, command: str, machine: Mapping[str, Any]) -> Verdict:
    """All figures of a comparison; targets hold for presets that have enough runs to judge by.

    Args:
        preset: how much was measured.
        measured: the runs.
        command: what repeats it.
        machine: where it was measured.
    """
    figures: list[Figure] = []
    for experiment in EXPERIMENTS:
        if programs_in(measured, experiment):
            figures += _figures_of(experiment, measured, machine)
    figures += _equality(measured)
    notes = [
        "Seconds of a line fitted through the medians, by the clock, from the first tick that "
        "counts until all is on the disk, conversion and labels included; with fewer frames for "
        "slow programs, see the preset. Totals count from the start of the program.",
    ]
    if any(one.bound is not None for one in figures):
        notes.append(
            "What costs less than can be measured has a bound by the spread of the runs (95 %); a "
            "ratio to it meets its target where the bound alone proves it. More runs (--repeat), "
            "or more values, narrow it."
        )
    if preset.name == QUICK:
        figures = [Figure(one.name, one.value, bound=one.bound) for one in figures]
        notes.append("The quick preset shows that everything runs; it judges nothing.")
    return Verdict("comparison", tuple(figures), notes, command)


def _figures_of(
    experiment: Experiment, measured: Measured, machine: Mapping[str, Any]
) -> list[Figure]:
    many = machine["cores"] >= _MANY_CORES
    if experiment == "totals":
        with_card = many and bool(machine["gpu"])
        return _totals(measured, TARGET_TOTAL_OF_MANY_CORES if with_card else TARGET_TOTAL)
    scale = 100.0 if experiment == "objects" else 1.0
    figures: list[Figure] = []
    lines: dict[tuple[str, Quantity], Line] = {}
    for name in programs_in(measured, experiment):
        for quantity in _QUANTITIES:
            found = line(of(measured, experiment, name), quantity)
            if found is not None:
                lines[name, quantity] = found
        if (name, "recorded_s") in lines:
            title = f"{experiment}: {name}, ms {_UNITS[experiment]}"
            figures.append(_added(title, lines[name, "recorded_s"], 1e3 * scale))
    for slower, faster, least, least_of_many in RATIO_TARGETS[experiment]:
        for quantity, label in _QUANTITIES.items():
            pair = lines.get((slower, quantity)), lines.get((faster, quantity))
            if pair[0] is None or pair[1] is None:
                continue
            target = least_of_many if many else least
            wanted = target if quantity == "recorded_s" else None
            title = f"{experiment}: {slower} / {faster}{label}"
            figures.append(_ratio(title, pair[0], pair[1], wanted))
    figures += _whole_runs(experiment, measured, many)
    if experiment == "frames":
        figures += _steadiness(measured, lines)
    if experiment in ("frames", "cameras"):
        figures += _memory(experiment, measured)
    return figures


def _added(title: str, added: Line, scale: float) -> Figure:
    """What a unit adds; where that is lost in the spread of the runs, what it cannot exceed."""
    if added.is_measurable:
        return Figure(title, scale * added.per_unit_s)
    if math.isnan(added.error_s):
        return Figure(title, "less than one run of each can show")
    return Figure(title, scale * added.most_s, bound="<=")


def _ratio(title: str, slower: Line, faster: Line, target: float | None) -> Figure:
    """How many times as much the slower adds; the least that is proved, where one is not known."""
    if slower.is_measurable and faster.is_measurable:
        return Figure(title, slower.per_unit_s / faster.per_unit_s, ">=", target)
    proved = slower.least_s / faster.most_s if faster.most_s > 0.0 else 0.0
    return Figure(title, proved, ">=", target, bound=">=")


def _whole_runs(experiment: Experiment, measured: Measured, many_cores: bool) -> list[Figure]:
    """Runs with the start of the program: the time of all cameras, the CPU time of one LiDAR."""
    if experiment not in ("cameras", "lidars"):
        return []
    other = DISCARD if experiment == "cameras" else NUMPY
    runs, others = (of(measured, experiment, name) for name in (CARSTAGE, other))
    values = sorted(set(values_in(runs)) & set(values_in(others)))
    if not values:
        return []
    if experiment == "cameras":
        name = f"cameras: whole time with {values[-1]}, {CARSTAGE} / {other}"
        ratio = spread(runs, values[-1]).median_s / spread(others, values[-1]).median_s
        target = TARGET_RUN_OF_MANY_CORES
    else:
        name = f"lidars: CPU time of a run with {values[0]}, {CARSTAGE} / {other}"
        ratio = spread(runs, values[0]).cpu_s / spread(others, values[0]).cpu_s
        target = TARGET_LIDAR_CPU_OF_MANY_CORES
    return [Figure(name, ratio, "<=", target if many_cores else None)]


def _steadiness(measured: Measured, lines: Mapping[tuple[str, Quantity], Line]) -> list[Figure]:
    figures = []
    own = lines.get((CARSTAGE, "recorded_s"))
    if own is not None and own.values > 2:
        figures.append(Figure("frames: R2 of Car-STAGE's line", own.r2, ">=", TARGET_R2))
    spreads = {}
    for name in (CARSTAGE, NATIVE):
        runs = of(measured, "frames", name)
        spreads[name] = [spread(runs, value) for value in values_in(runs)]
    if all(spreads.values()) and min(one.runs for one in spreads[CARSTAGE]) > 1:
        own_s, native_s = (
            float(np.median([one.iqr_s for one in spreads[name]])) for name in (CARSTAGE, NATIVE)
        )
        figures.append(Figure("frames: median IQR of native-png, s", native_s))
        figures.append(
            Figure("frames: median IQR of Car-STAGE, s", own_s, "<=", round(native_s, 4))
        )
    return figures


def _memory(experiment: Experiment, measured: Measured) -> list[Figure]:
    runs = of(measured, experiment, CARSTAGE)
    queues = [result.found["queue_mb"] for _, result in runs if "queue_mb" in result.found]
    figures = []
    if queues:
        figures.append(
            Figure(
                f"{experiment}: most data that waited, MB",
                max(queues),
                "<=",
                RAW_QUEUE_MB * _TICK_SHARE,
            )
        )
    values = values_in(runs)
    if experiment == "frames" and len(values) > 2:
        # The shortest runs end before all of their processes have grown up. What waits for the
        # disk has a bound of its own, see above, and is more where the disk is slow. Its peak is
        # known by samples only, hence medians of runs here, too.
        most, less = (_beside_queue_mb(runs, value) for value in (values[-1], values[-2]))
        growth = most / less
        name = f"frames: memory without what waited, {values[-1]} frames / {values[-2]}"
        figures.append(Figure(name, growth, "<=", TARGET_GROWTH))
    return figures


def _beside_queue_mb(runs: Measured, value: int) -> float:
    return float(
        np.median(
            [
                result.peak_mb - result.found.get("queue_mb", 0.0)
                for trial, result in runs
                if trial.value == value
            ]
        )
    )


def _totals(measured: Measured, target: float) -> list[Figure]:
    figures = []
    own_values, least_values = (
        values_in(of(measured, "totals", name)) for name in (CARSTAGE, DISCARD)
    )
    for value in sorted(set(own_values) & set(least_values)):
        own, least = (
            spread(of(measured, "totals", name), value).median_s for name in (CARSTAGE, DISCARD)
        )
        name = f"totals: Car-STAGE / discard with {value} cameras"
        figures.append(Figure(name, own / least, "<=", target))
    return figures


def _equality(measured: Measured) -> list[Figure]:
    """Whether programs wrote the same pictures, clouds and boxes."""
    compared, different, boxes, wrong = 0, [], 0, 0
    looked: dict[tuple[str, int], dict[str, Mapping[str, Any]]] = {}
    for trial, result in measured:
        if result.contents:
            place = looked.setdefault((trial.experiment, trial.value), {})
            place[trial.program] = result.contents
    for programs in looked.values():
        reference: dict[str, Any] = {}
        for name in sorted(programs, key=lambda one: (one == CARSTAGE, one)):
            if not PROGRAMS[name].lossless:
                continue
            contents = dict(programs[name])
            rows = contents.pop("boxes", None)
            for key, digest in contents.items():
                if key in reference:
                    compared += 1
                    if digest != reference[key]:
                        different.append(f"{name} {key}")
                else:
                    reference[key] = digest
            if rows is not None and "boxes" in reference:
                count, bad = _compare_boxes(rows, reference["boxes"])
                boxes, wrong = boxes + count, wrong + bad
            elif rows is not None:
                reference["boxes"] = rows
    figures = []
    if compared:
        figures.append(Figure("pictures and clouds compared between programs", compared, ">=", 1))
        figures.append(Figure("pictures and clouds that differ", len(different), "==", 0))
    if boxes:
        figures.append(Figure("boxes compared with native-png's", boxes, ">=", 1))
        figures.append(Figure("boxes that differ", wrong, "==", 0))
    return figures


def _compare_boxes(rows: Iterable[list[float]], others: Iterable[list[float]]) -> tuple[int, int]:
    """How many boxes two programs have in frames of both, and how many differ or are one's."""
    one, two = ({(row[0], row[1]): row[2:] for row in table} for table in (rows, others))
    frames = {frame for frame, _ in one} & {frame for frame, _ in two}
    one, two = ({key: table[key] for key in table if key[0] in frames} for table in (one, two))
    bad = len(one.keys() ^ two.keys())
    for key in one.keys() & two.keys():
        near = np.allclose(one[key][:4], two[key][:4], atol=_BOX_TOLERANCE_PX, rtol=0.0)
        bad += not near or one[key][4:] != two[key][4:]
    return len(one.keys() | two.keys()), bad
