"""The runs of all datasets below the roots, read from their folders."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from carstage.runs.folder import SHORT_PLAN_VERSION
from carstage.runs.reading import Alive, liveness, read_document
from carstage.spec import EpisodeSpec
from carstage.web.messages import RunSensor
from carstage.web.roots import Roots

_MOST_PER_DATASET = 100


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What is fixed about a run, from ``plan.json``.

    Attributes:
        ticks, frames: over all episodes.
    """

    config: Mapping[str, Any]
    episodes: int
    ticks: int
    frames: int
    sensors: tuple[RunSensor, ...]


@dataclass(frozen=True, slots=True)
class RunRecord:
    """A run with a folder.

    Attributes:
        dataset: id of its dataset.
        status: the content of ``status.json``.
    """

    run_id: str
    dataset: str
    folder: Path
    status: Mapping[str, Any]
    alive: Alive

    @property
    def out(self) -> Path:
        """Folder of its dataset."""
        return self.folder.parent.parent

    def plan(self) -> RunPlan | None:
        """Its plan; None before it is written."""
        path = self.folder / "plan.json"
        try:
            return read_plan(path, path.stat().st_mtime_ns)
        except OSError:
            return None


class RunRecords:
    """Looks through the folders of runs; what has ended is read once.

    Args:
        roots: where the datasets are.
    """

    def __init__(self, roots: Roots) -> None:
        self._roots = roots
        self._lock = threading.Lock()
        self._known: dict[Path, RunRecord] = {}

    def all(self) -> dict[str, RunRecord]:
        """All runs by id."""
        with self._lock:
            found: dict[Path, RunRecord] = {}
            for dataset in self._roots.datasets().values():
                folders = sorted((dataset.path / "runs").glob("*/status.json"))
                for path in folders[-_MOST_PER_DATASET:]:
                    folder = path.parent
                    known = self._known.get(folder)
                    if known is None or known.alive != "ended":
                        known = _record(folder, dataset.dataset)
                    if known is not None:
                        found[folder] = known
            self._known = found
            return {record.run_id: record for record in found.values()}

    def fresh(self, record: RunRecord) -> RunRecord:
        """The same run as it is now."""
        return _record(record.folder, record.dataset) or record


def _record(folder: Path, dataset: str) -> RunRecord | None:
    status = read_document(folder / "status.json")
    if status is None or status.get("run_id") != folder.name:
        return None
    return RunRecord(folder.name, dataset, folder, status, liveness(status))


@lru_cache(maxsize=512)
def read_plan(path: Path, _changed_ns: int) -> RunPlan | None:
    """What ``plan.json`` fixes; kept by the file's time."""
    document = read_document(path)
    if document is None:
        return None
    entries = document.get("episodes", ())
    try:
        if document.get("format_version") == SHORT_PLAN_VERSION:
            specs = [EpisodeSpec.from_json(document["first_spec"])]
            ticks, frames = int(document["steps"]), int(document["saved_frames"])
        else:
            specs = [EpisodeSpec.from_json(entry["spec"]) for entry in entries]
            ticks = sum(spec.steps for spec in specs)
            frames = sum(spec.saved_frames for spec in specs)
        count = len(entries)
    except (KeyError, TypeError, ValueError):
        return None  # of another program: shown as a run without a plan
    return RunPlan(
        config=document.get("config", {}),
        episodes=count,
        ticks=ticks,
        frames=frames,
        sensors=tuple(
            RunSensor(id=sensor.id, kind=sensor.kind)
            for sensor in (specs[0].written_sensors if specs else ())
        ),
    )
