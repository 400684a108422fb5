"""What validation found, as markup: a section of the report, and a separate page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from carstage import __version__
from carstage.dataset.collection import Dataset
from carstage.files.whole import write_whole
from carstage.report import html
from carstage.storage import DatasetPath
from carstage.validation.checks.catalogue import GROUPS
from carstage.validation.checks.findings import Problem
from carstage.validation.validator import ValidationReport

_MOST_PROBLEMS = 200


def write_validation(path: str | DatasetPath, report: ValidationReport, out: Path) -> Path:
    """Write a verdict as one self-contained HTML page.

    Args:
        path: folder of the dataset.
        report: the verdict over it.
        out: the file to write.

    Raises:
        DatasetError: the folder is no dataset.
    """
    name, figures = Dataset(path).name, report.figures
    body = (
        f'<div class="head"><h1>{escape(name)}</h1>{badge(report)}</div>'
        '<p class="soft">What <code>carstage validate</code> computed again from the files.</p>'
        + html.tiles(
            [
                html.counted(figures["episodes"], "episode"),
                html.counted(figures["frames"], "frame"),
                ("files read and hashed", f"{figures['files']:,}"),
                ("bytes", html.size(figures["bytes"])),
                html.counted(_total(report, "error"), "error"),
                html.counted(_total(report, "warning"), "warning"),
            ]
        )
        + validation_section(report)
        + f"<footer>Written by Car-STAGE {escape(__version__)}.</footer>"
    )
    write_whole(out, html.page(f"{name}: validation", body).encode())
    return out


def badge(report: ValidationReport) -> str:
    """The verdict in two words."""
    warnings = _total(report, "warning")
    if not report.ok:
        return '<span class="badge bad">✗ not valid</span>'
    if warnings:
        plural = "" if warnings == 1 else "s"
        return f'<span class="badge warn">✓ valid, {warnings} warning{plural}</span>'
    return '<span class="badge good">✓ valid</span>'


def validation_section(report: ValidationReport) -> str:
    """Problems, what was measured, and the verdict of every check."""
    return (
        "<h2>Validation</h2>"
        + _problems(report.problems)
        + "<h3>Measured, from the files alone</h3>"
        + html.table(("What", "Result"), _measured(report))
        + "<h3>Checks</h3>"
        + _checks(report)
    )


def _total(report: ValidationReport, severity: str) -> int:
    return sum(
        count for counts in report.counts.values() for kind, count in counts.items()
        if kind == severity
    )  # fmt: skip


def _problems(problems: Sequence[Problem]) -> str:
    if not problems:
        return '<p class="good">No problem was found.</p>'
    ordered = sorted(problems, key=lambda problem: problem.severity != "error")
    listed = [
        (p.severity, p.check, p.episode or "", "" if p.frame is None else p.frame, p.sensor or "",
         p.message)
        for p in ordered[:_MOST_PROBLEMS]
    ]  # fmt: skip
    more = len(problems) - len(listed)
    rest = f'<p class="soft">and {more} more; see <code>carstage validate</code>.</p>'
    return (
        "<h3>Problems</h3>"
        + html.table(("Severity", "Check", "Episode", "Frame", "Sensor", "What"), listed)
        + (rest if more else "")
    )


def _measured(report: ValidationReport) -> list[tuple[str, str]]:
    figures = report.figures
    hull, motion = figures["hull"], figures["motion"]
    rows = [
        ("Files read, hashed and decoded", f"{figures['files']:,} ({html.size(figures['bytes'])})"),
        (
            "Pixels of objects outside the projection of their box, grown by 2 px",
            f"{hull['pixels_outside']:,} of {hull['pixels']:,} "
            f"(farthest {hull['farthest_px']:.2f} px)",
        ),
    ]
    for pair, found in figures["lidar_depth"].items():
        rows.append(
            (
                f"LiDAR points that agree with depth to 0.1 m + 1 % ({pair})",
                _share(found["share"], found["points_comparable"], "in view"),
            )
        )
    rows.append(("LiDAR points in boxes, recounted", f"{figures['lidar_points_in_boxes']:,}"))
    for camera, found in figures["flow"].items():
        rows.append(
            (
                f"Pixels whose flow is that of depth and camera motion ({camera})",
                _share(found["share"], found["pixels"], "to compare"),
            )
        )
    variants = figures["variants"]
    if variants["groups"]:
        rows.append(
            (
                f"Farthest between poses of variants, {variants['poses']:,} compared",
                f"{variants['largest_m']:g} m, {variants['largest_deg']:g} degrees",
            )
        )
    pairs = figures["patch_pairs"]
    if pairs["images"]:
        wet = f"; {pairs['mirrored']:,} where wet surfaces mirror" if pairs["mirrored"] else ""
        rows.append(
            (
                f"Pixels outside of patches that differ with and without, {pairs['pixels']:,} "
                "compared",
                f"{pairs['differing']:,}{wet}",
            )
        )
    rows.append(
        ("Steps of objects that are those of their velocities",
         _share(motion["share"], motion["steps"], "to compare"))
    )  # fmt: skip
    for camera, ratio in figures["rgb_edges"].items():
        fits = [fit for fit in figures["rgb_frame"].get(camera, {}).values() if fit is not None]
        neighbour = f"; than at those of the neighbouring frames: {min(fits):.1f}" if fits else ""
        rows.append(
            (
                f"How many times steeper the image is where its labels change ({camera})",
                "too little to see" if ratio is None else f"than beside: {ratio:.1f}{neighbour}",
            )
        )
    for camera, pictures in figures["pictures"].items():
        rows.append(
            (f"Mean brightness of the images, 0 to 255 ({camera})", f"{pictures['brightness']:.0f}")
        )
    return rows


def _share(share: float | None, count: int, nothing: str) -> str:
    return f"too few {nothing}" if share is None else f"{share:.2%} of {count:,}"


def _checks(report: ValidationReport) -> str:
    rows = []
    for group, rules in GROUPS.items():
        for name, rule in rules.items():
            errors, warnings = (report.counts[name][kind] for kind in ("error", "warning"))
            found = [
                f"{count:,} {kind}{'' if count == 1 else 's'}"
                for kind, count in (("error", errors), ("warning", warnings))
                if count
            ]
            # No tick: where the rig lacks what a check compares, it has found nothing either.
            rows.append((group, name, rule, ", ".join(found) or "nothing found"))
    return html.table(("Group", "Check", "Rule", "Result"), rows)
