"""Results in words: a configuration, a validation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.storage import DatasetPath
    from carstage.validation import Problem, ValidationReport


def describe_config(config: Config, *, offline: bool = False) -> tuple[dict[str, Any], str]:
    """What a configuration would record: for programs and for people; see ``preflight.judge``."""
    from carstage.plan.estimate import estimate_run
    from carstage.runs.preflight import judge, size_text

    episodes = judge(config, offline=offline)
    estimate = estimate_run(config, episodes)
    hidden = sum(sensor.hidden for sensor in episodes[0].streams.values())
    summary = {
        "ok": True,
        "episodes": len(episodes),
        "frames": episodes.frames,
        "sensors": len(config.located_sensors()),
        "hidden_sensors": hidden,
        "dataset_bytes": estimate.dataset_bytes,
        "peak_bytes": estimate.peak_bytes,
        "duration_s": round(estimate.duration_s),
        "sampled": [] if config.campaign is None else list(config.campaign.sample),
        "warnings": config.warnings(),
    }
    each = sorted({int(frames) for frames in episodes.costs["frames"]})
    sensors = len(config.located_sensors())
    frames = f"{each[0]}" if len(each) == 1 else f"{each[0]} to {each[-1]}"
    text = (
        f"{config.name}: {len(episodes)} x {frames} frames, "
        f"{sensors} sensor{'' if sensors == 1 else 's'}"
        f"{f' (and {hidden} hidden for labels)' if hidden else ''}, about "
        f"{size_text(estimate.dataset_bytes)}, {size_text(estimate.peak_bytes)} at most on the way."
    )
    if config.campaign is not None and config.campaign.sample:
        text += f"\nsampled ({config.campaign.method}): {', '.join(config.campaign.sample)}."
    for warning in config.warnings():
        text += f"\nwarning: {warning}"
    return summary, text


def describe_presets() -> tuple[dict[str, Any], str]:
    """The rigs of `rig.preset`: for programs and for people."""
    from collections import Counter

    from carstage.config import RIG_PRESETS

    presets, lines = {}, []
    for name, rig in RIG_PRESETS.items():
        sensors = rig.sensors()
        counts = Counter(sensor.kind for sensor in sensors)
        presets[name] = {
            "title": rig.title,
            "source": rig.source,
            "sensors": [sensor.model_dump(mode="json", exclude_none=True) for sensor in sensors],
        }
        kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
        lines.append(f"{name}: {rig.title} ({kinds}).\n    Source: {rig.source}.")
    return presets, "\n".join(lines)


def describe_problem(problem: Problem) -> str:
    """One line for a finding of the validation."""
    frame = None if problem.frame is None else f"frame {problem.frame}"
    place = [part for part in (problem.episode, problem.sensor, frame) if part is not None]
    where = f" ({', '.join(place)})" if place else ""
    return f"{problem.severity}: {problem.check}: {problem.message}{where}"


def describe_validation(dataset: DatasetPath, report: ValidationReport) -> str:
    """The verdict in a line."""
    errors = sum(problem.severity == "error" for problem in report.problems)
    warnings = len(report.problems) - errors
    verdict = "valid" if report.ok else "NOT valid"
    figures = report.figures
    return (
        f"{dataset}: {verdict}; {figures.get('episodes', 0)} episodes, "
        f"{figures.get('frames', 0)} frames, {figures.get('files', 0)} files, "
        f"{errors} errors, {warnings} warnings"
    )
