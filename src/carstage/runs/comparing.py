"""Several runs beside each other: what each took, and which of their settings differ."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carstage.config.fields import path_text
from carstage.files.bounded import open_regular
from carstage.runs.events import FramesConverted, Load, event_of
from carstage.runs.keeping import label_of
from carstage.runs.reading import liveness, parse_event, read_document

_ABSENT = object()
_COUNTED = (b'"load"', b'"frames_converted"')
"""What the lines of counted events contain; most lines are ticks."""


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What a run took.

    Attributes:
        run_id: its id.
        name: that it is shown by.
        state: ``stalled`` or ``dead`` where it is, else as in ``status.json``.
        took_s: from its begin to its end, or until now.
        episodes: how many are there, with those that were there before.
        planned: how many there are to be.
        failed: how many have failed.
        frames: saved frames that it has converted.
        frames_s: the same per second of ``took_s``.
        cpu_cores: mean over the run.
        memory_bytes: the most at one time.
        written_bytes: what went to disks.
    """

    run_id: str
    name: str
    state: str
    took_s: float | None
    episodes: int
    planned: int
    failed: int
    frames: int
    frames_s: float | None
    cpu_cores: float | None
    memory_bytes: int | None
    written_bytes: int | None


@dataclass(frozen=True, slots=True)
class DifferingSetting:
    """A setting that is not the same in all of several configurations.

    Attributes:
        path: such as ``rig.sensors[TOP].attributes.channels``.
        values: one for each configuration; None where it has none.
    """

    path: str
    values: tuple[Any, ...]


@dataclass(slots=True)
class _Counted:
    """Sums over the events of a run."""

    frames: int = 0
    cpu_s: float = 0.0
    seconds: float = 0.0
    memory_bytes: int | None = None
    written_bytes: float | None = None

    def add(self, load: Load, seconds: float) -> None:
        """Take in what was measured over so many seconds."""
        self.seconds += seconds
        self.cpu_s += seconds * load.cpu_cores
        self.memory_bytes = max(self.memory_bytes or 0, load.memory_bytes)
        if load.written_bytes_s is not None:
            self.written_bytes = (self.written_bytes or 0.0) + seconds * load.written_bytes_s


def run_figures(folder: Path) -> RunFigures:
    """What a run took, from its folder.

    Args:
        folder: the run's, ``OUT/runs/RUN``.

    Raises:
        OSError: its events cannot be read.
    """
    status = read_document(folder / "status.json") or {}
    alive = liveness(status)
    begun, last = status.get("pid_started"), status.get("heartbeat")
    last = time.time() if alive == "running" else last
    took_s = last - begun if begun and last else None
    counts = status.get("episodes") or {}
    plan = read_document(folder / "plan.json") or {}
    name = label_of(folder) or (plan.get("config") or {}).get("name", "")
    counted = _counted(folder, begun or 0.0)
    return RunFigures(
        run_id=folder.name,
        name=name,
        state=str(status.get("state")) if alive in ("ended", "running") else alive,
        took_s=took_s,
        episodes=counts.get("committed", 0) + counts.get("skipped", 0),
        planned=counts.get("total", 0),
        failed=counts.get("failed", 0),
        frames=counted.frames,
        frames_s=counted.frames / took_s if took_s else None,
        cpu_cores=counted.cpu_s / counted.seconds if counted.seconds else None,
        memory_bytes=counted.memory_bytes,
        written_bytes=None if counted.written_bytes is None else int(counted.written_bytes),
    )


def _counted(folder: Path, begun_s: float) -> _Counted:
    """Sums over the events; the load of several workers is that of the whole run."""
    found = _Counted()
    try:
        descriptor = open_regular(folder / "events.jsonl")
    except FileNotFoundError:
        return found
    before_s = begun_s
    with os.fdopen(descriptor, "rb") as lines:
        for line in lines:
            parsed = parse_event(line) if any(word in line for word in _COUNTED) else None
            if parsed is None:
                continue
            event = event_of(parsed)
            if isinstance(event, FramesConverted):
                found.frames += event.frames
            elif isinstance(event, Load) and not parsed.get("worker"):
                found.add(event, max(0.0, event.time_s - before_s))
                before_s = event.time_s
    return found


def differing_settings(configs: Sequence[Mapping[str, Any]]) -> list[DifferingSetting]:
    """Settings that are not the same in all configurations, in their order there.

    Sensors are told apart by their ids, other entries of lists are one value together. The names
    of configurations are left out.

    Args:
        configs: as ``dump_config`` gives them.
    """
    found: list[DifferingSetting] = []
    _compare([{**config, "name": ""} for config in configs], [], found)
    return found


def _compare(values: Sequence[Any], path: list[str | int], found: list[DifferingSetting]) -> None:
    if all(value == values[0] for value in values):
        return
    keyed = [_keyed(value) for value in values]
    mappings = [value for value in keyed if value is not None]
    if len(mappings) == len(values):
        for key in dict.fromkeys(key for mapping in mappings for key in mapping):
            _compare([mapping.get(key, _ABSENT) for mapping in mappings], [*path, key], found)
        return
    shown = tuple(None if value is _ABSENT else value for value in values)
    if any(value != shown[0] for value in shown):
        found.append(DifferingSetting(_text(path), shown))


def _keyed(value: Any) -> Mapping[str, Any] | None:
    """A mapping, or a list of sensors by their ids; None for what is one value."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, list) and all(isinstance(one, Mapping) and "id" in one for one in value):
        named = {f"[{one['id']}]": one for one in value}
        return named if len(named) == len(value) else None
    return None


def _text(path: Sequence[str | int]) -> str:
    return path_text(path).replace(".[", "[")
