"""Results in words: a configuration, a validation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.validation import Problem, ValidationReport


#: `config check` cannot know how many spawn points a map has.
_ANY_SPAWN_POINT = 1 << 30


def describe_config(config: Config) -> tuple[dict[str, Any], str]:
    """What a configuration would record: for programs and for people."""
    from carstage.plan.estimate import estimate_run
    from carstage.plan.planning import ServerFacts, plan_episodes
    from carstage.runs.preflight import recording_of, size_text

    # Sizes do not depend on the map: the server's own list is asked when the run starts.
    recording = recording_of(config)
    names = [config.map.choice, *(config.map.random_from or ())]
    names += [] if recording is None else [recording.map]
    facts = ServerFacts(
        maps={name.rsplit("/", 1)[-1]: _ANY_SPAWN_POINT for name in names if name is not None}
    )
    episodes = plan_episodes(config, facts, recording)
    estimate = estimate_run(config, episodes)
    hidden = sum(sensor.hidden for sensor in episodes[0].sensors)
    summary = {
        "ok": True,
        "episodes": len(episodes),
        "frames": config.saved_frames * len(episodes),
        "sensors": len(config.sensors),
        "hidden_sensors": hidden,
        "dataset_bytes": estimate.dataset_bytes,
        "peak_bytes": estimate.peak_bytes,
        "duration_s": round(estimate.duration_s),
        "warnings": config.warnings(),
    }
    text = (
        f"{config.name}: {len(episodes)} x {config.saved_frames} frames, "
        f"{len(config.sensors)} sensors (and {hidden} hidden ones for labels), about "
        f"{size_text(estimate.dataset_bytes)}, {size_text(estimate.peak_bytes)} at most on the way."
    )
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


def describe_validation(dataset: Path, report: ValidationReport) -> str:
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
