"""A comparison for readers: JSON, tables in Markdown, plots, and a page that holds them all."""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from carstage.bench.comparison.figures import (
    Line,
    Measured,
    line,
    of,
    programs_in,
    spread,
    values_in,
)
from carstage.bench.comparison.plots import plot_all
from carstage.bench.comparison.presets import EXPERIMENTS, Experiment, Preset
from carstage.bench.comparison.programs import PROGRAMS
from carstage.bench.verdict import Verdict
from carstage.files.whole import write_whole

RESULT_FILE, TABLES_FILE, PAGE_FILE = "comparison.json", "comparison.md", "comparison.html"
_PARAGRAPHS: Mapping[Experiment, tuple[str, str, float]] = {
    "frames": ("Frames", "ms per frame", 1.0),
    "cameras": ("Cameras", "ms per added camera and frame", 1.0),
    "lidars": ("LiDARs", "ms per added LiDAR and frame", 1.0),
    "objects": ("Objects", "ms per added 100 actors and frame", 100.0),
    "totals": ("Totals, the server at its own pace", "", 1.0),
}
_STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;"
    "color:#1b1f24;background:#fff}table{border-collapse:collapse;margin:1rem 0}"
    "th,td{border-bottom:1px solid #d5dae0;padding:.3rem .7rem;text-align:right}"
    "th:first-child,td:first-child,.words td{text-align:left}img{max-width:100%;height:auto}"
    ".bad{color:#b3261e;font-weight:600}"
    "@media(prefers-color-scheme:dark){body{color:#e6e9ee;background:#14171c}"
    "th,td{border-color:#343b45}img{background:#fff}.bad{color:#ff8a80}}"
)

Rows = list[tuple[str, ...]]


def write_report(
    out: Path,
    preset: Preset,
    machine: Mapping[str, Any],
    measured: Measured,
    verdict: Verdict,
) -> list[Path]:
    """Write every form of a comparison; returns what was written.

    Args:
        out: the folder.
        preset: how much was measured.
        machine: where.
        measured: the runs.
        verdict: their figures.
    """
    tables = {
        experiment: _table(experiment, measured)
        for experiment in EXPERIMENTS
        if programs_in(measured, experiment)
    }
    rows = [{**asdict(trial), **_without_contents(asdict(result))} for trial, result in measured]
    record = {
        **verdict.record(),
        "preset": asdict(preset),
        "machine": dict(machine),
        "programs": dict(_described(measured)),
        "trials": rows,
    }
    plots = plot_all(out, measured)
    paths = [out / RESULT_FILE, out / TABLES_FILE, out / PAGE_FILE]
    contents = (
        json.dumps(record, indent=1, allow_nan=False) + "\n",
        "\n".join(_markdown(tables, machine, verdict)) + "\n",
        _page(tables, plots, preset, machine, measured, verdict),
    )
    for path, content in zip(paths, contents, strict=True):
        write_whole(path, content.encode())
    return [*paths, *plots.values()]


def _described(measured: Measured) -> list[tuple[str, str]]:
    """Every program that has a run, and what it is."""
    names = dict.fromkeys(trial.program for trial, _ in measured)
    return [(name, PROGRAMS[name].what) for name in names]


def _without_contents(row: dict[str, Any]) -> dict[str, Any]:
    row.pop("contents")
    return {name: _rounded(one) if isinstance(one, float) else one for name, one in row.items()}


def _rounded(value: float) -> float | None:
    """Three decimals; None for what is not known, since JSON has no NaN."""
    return None if math.isnan(value) else round(value, 3)


def _table(experiment: Experiment, measured: Measured) -> Rows:
    """Programs by what each adds, their totals at the largest value, CPU and memory there."""
    _, unit, scale = _PARAGRAPHS[experiment]
    head = ["program", unit or "value", "R2", "runs"]
    head += ["frames", "total, s (median)", "IQR, s", "mean ± sd, s"]
    head += ["CPU, s", "server's CPU, s", "memory, MB", "files, MB"]
    rows: Rows = [tuple(head)]
    for name in programs_in(measured, experiment):
        runs = of(measured, experiment, name)
        value = values_in(runs)[-1]
        last = [(trial, result) for trial, result in runs if trial.value == value]
        found, all_of = line(runs), spread(runs, value)
        per = "" if found is None else _per_unit(found, 1e3 * scale)
        r2 = "" if found is None or found.values < 3 else f"{found.r2:.3f}"
        rows.append(
            (
                name,
                per if unit else str(value),
                r2,
                str(all_of.runs),
                str(last[0][0].frames),
                f"{all_of.median_s:.1f}",
                f"{all_of.iqr_s:.2f}",
                f"{all_of.mean_s:.1f} ± {all_of.sd_s:.2f}" if all_of.runs > 1 else "",
                f"{all_of.cpu_s:.1f}",
                f"{all_of.server_cpu_s:.1f}",
                f"{all_of.peak_mb:.0f}",
                f"{last[0][1].mb:.0f}",
            )
        )
    return rows


def _per_unit(found: Line, scale: float) -> str:
    if found.is_measurable:
        return f"{scale * found.per_unit_s:.1f}"
    return "?" if math.isnan(found.error_s) else f"< {scale * found.most_s:.1f}"


def _markdown(
    tables: Mapping[Experiment, Rows], machine: Mapping[str, Any], verdict: Verdict
) -> Iterator[str]:
    yield f"# Comparison: {'all targets met' if verdict.ok else 'some targets missed'}"
    yield ""
    yield _machine_text(machine)
    yield ""
    yield from _markdown_table(_figure_rows(verdict))
    for experiment, rows in tables.items():
        yield ""
        yield f"## {_PARAGRAPHS[experiment][0]}"
        yield ""
        yield from _markdown_table(rows)
    yield ""
    yield from verdict.notes


def _markdown_table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    for number, row in enumerate(rows):
        yield f"| {' | '.join(row)} |"
        if number == 0:
            yield "|" + "---|" * len(row)


def _figure_rows(verdict: Verdict) -> Rows:
    rows: Rows = [("figure", "value", "target", "")]
    for figure in verdict.figures:
        target = "" if figure.target is None else f"{figure.relation} {figure.target:g}"
        rows.append((figure.name, figure.shown(".3g"), target, "" if figure.ok else "missed"))
    return rows


def _machine_text(machine: Mapping[str, Any]) -> str:
    gpu = f", {machine['gpu']}" if machine.get("gpu") else ""
    return (
        f"{machine['date']}: {machine['cpu']}, {machine['cores']} cores{gpu}, "
        f"{machine['memory_gb']} GB, {machine['disk']}, {machine['system']}, "
        f"Python {machine['python']}; {machine['slowness']} times as slow as the reference machine."
    )


def _page(
    tables: Mapping[Experiment, Rows],
    plots: Mapping[str, Path],
    preset: Preset,
    machine: Mapping[str, Any],
    measured: Measured,
    verdict: Verdict,
) -> str:
    """One file without outside parts."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width'>",
        f"<title>Car-STAGE: comparison</title><style>{_STYLE}</style>",
        "<h1>Car-STAGE compared with other ways to record</h1>",
        f"<p>{html.escape(_machine_text(machine))}</p>",
        f"<p>Preset <code>{preset.name}</code>, <code>{html.escape(verdict.command)}</code></p>",
        _html_table(_figure_rows(verdict)),
        "<h2>Programs</h2>",
        _html_table(
            [("program", ""), *_described(measured)],
            of_words=True,
        ),
    ]
    for experiment, rows in tables.items():
        parts.append(f"<h2>{_PARAGRAPHS[experiment][0]}</h2>")
        if experiment in plots:
            picture = base64.b64encode(plots[experiment].read_bytes()).decode()
            parts.append(
                f"<img alt='Seconds of each program' src='data:image/svg+xml;base64,{picture}'>"
            )
        parts.append(_html_table(rows))
    parts += [f"<p>{html.escape(note)}</p>" for note in verdict.notes]
    return "\n".join(parts) + "\n"


def _html_table(rows: Sequence[Sequence[str]], *, of_words: bool = False) -> str:
    def line_of(row: Sequence[str], tag: str) -> str:
        mark = " class=bad" if "missed" in row else ""
        cells = "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in row)
        return f"<tr{mark}>{cells}</tr>"

    head, *body = rows
    kind = " class=words" if of_words else ""
    return (
        f"<table{kind}>{line_of(head, 'th')}{''.join(line_of(row, 'td') for row in body)}</table>"
    )
