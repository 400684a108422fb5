"""The runs of all datasets below the roots, read from their folders."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from carstage.runs.folder import SHORT_PLAN_VERSION
from carstage.runs.keeping import LABEL_FILE, label_of
from carstage.runs.reading import Alive, liveness, read_document
from carstage.spec import DeviceDriverSpec, EpisodeSpec
from carstage.storage.remote_path import DatasetPath
from carstage.web.messages import DrivenAtPage, RunSensor
from carstage.web.preview.shown_sensors import shown_sensors
from carstage.web.roots import Roots
from carstage.web.runs.launches import Launches

_MOST_PER_DATASET = 100


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What is fixed about a run, from ``plan.json``.

    Attributes:
        ticks, frames: over all episodes.
        driven: how the ego of the first episode is driven at the page; None: otherwise.
    """

    config: Mapping[str, Any]
    episodes: int
    ticks: int
    frames: int
    sensors: tuple[RunSensor, ...]
    driven: DrivenAtPage | None


@dataclass(frozen=True, slots=True)
class RunRecord:
    """A run with a folder.

    Attributes:
        dataset: id of its dataset.
        out: place of its dataset.
        status: the content of ``status.json``.
    """

    run_id: str
    dataset: str
    out: DatasetPath
    folder: Path
    status: Mapping[str, Any]
    alive: Alive

    @property
    def work(self) -> Path:
        """What holds the folder ``runs``."""
        return self.folder.parent.parent

    def label(self) -> str | None:
        """The name that it was given afterwards, if it was."""
        path = self.folder / LABEL_FILE
        try:
            return _label(self.folder, path.stat().st_mtime_ns)
        except OSError:
            return None

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
        launches: know where the runs are that were started here.
    """

    def __init__(self, roots: Roots, launches: Launches) -> None:
        self._roots = roots
        self._launches = launches
        self._lock = threading.Lock()
        self._known: dict[Path, RunRecord] = {}

    def all(self) -> dict[str, RunRecord]:
        """All runs by id."""
        with self._lock:
            found: dict[Path, RunRecord] = {}
            for folder, dataset, out in self._folders():
                known = self._known.get(folder)
                if known is None or known.alive != "ended" or not folder.exists():
                    known = _record(folder, dataset, out)
                if known is not None:
                    found[folder] = known
            self._known = found
            return {record.run_id: record for record in found.values()}

    def fresh(self, record: RunRecord) -> RunRecord:
        """The same run as it is now."""
        return _record(record.folder, record.dataset, record.out) or record

    def _folders(self) -> Iterator[tuple[Path, str, DatasetPath]]:
        """Folders of runs, each with its dataset; that of a launch may not be there."""
        from carstage.runs.preflight import work_folder

        for found in self._roots.datasets().values():
            runs = work_folder(found.path, None) / "runs"
            for path in sorted(runs.glob("*/status.json"))[-_MOST_PER_DATASET:]:
                yield path.parent, found.dataset, found.path
        for launch in self._launches.all():
            if launch.process is not None:
                out = launch.place
                folder = work_folder(out, launch.work) / "runs" / launch.run_id
                yield folder, self._roots.id_of(out), out


def _record(folder: Path, dataset: str, out: DatasetPath) -> RunRecord | None:
    status = read_document(folder / "status.json")
    if status is None or status.get("run_id") != folder.name:
        return None
    return RunRecord(folder.name, dataset, out, folder, status, liveness(status))


@lru_cache(maxsize=1000)
def _label(folder: Path, _changed_ns: int) -> str | None:
    return label_of(folder)


@lru_cache(maxsize=512)
def read_plan(path: Path, _changed_ns: int) -> RunPlan | None:
    """What ``plan.json`` fixes; kept by the file's time."""
    document = read_document(path)
    config = None if document is None else document.get("config", {})
    if document is None or not isinstance(config, dict):
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
    except (KeyError, TypeError, ValueError, AttributeError):
        return None  # of another program: shown as a run without a plan
    return RunPlan(
        config=config,
        episodes=count,
        ticks=ticks,
        frames=frames,
        sensors=tuple(
            RunSensor(id=sensor.id, kind=sensor.sensor.kind)
            for sensor in (shown_sensors(specs[0]) if specs else ())
        ),
        driven=_driven(specs[0]) if specs else None,
    )


def _driven(spec: EpisodeSpec) -> DrivenAtPage | None:
    driver = spec.ego.driver
    if not isinstance(driver, DeviceDriverSpec) or not driver.at_page:
        return None
    return DrivenAtPage(
        device=driver.kind,  # type: ignore[arg-type]
        camera=driver.camera,
        inputs=dict(driver.inputs),
    )
