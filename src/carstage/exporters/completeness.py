"""What a dataset lacks: frames, files, and labels whose class no format knows."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pyarrow.compute as pc

from carstage.dataset import Dataset, Episode
from carstage.dataset.ledger import recorded_frames
from carstage.dataset.saved_frames import Damage
from carstage.errors import CarStageError, DatasetError
from carstage.exporters.classes import CLASSES
from carstage.files.bounded import open_regular
from carstage.files.hashing import hash_of_file
from carstage.storage.marker import FileEntry
from carstage.storage.remote_path import DatasetPath
from carstage.validation import Problem
from carstage.validation.checks.files import DOCUMENTS, TABLES, check_file_list, label_files
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.ledger import check_ledger, check_row_sensors

Progress = Callable[[int, int], object]


@dataclass(frozen=True, slots=True)
class Completeness:
    """What was found.

    Attributes:
        problems: what is missing or damaged.
        whole: ids of the episodes whose documents and tables are whole; others cannot be exported.
        damage: by episode, the sensors' and labels' files that are missing or changed.
        agent_damage: by episode and agent beside the ego, likewise; where those are exported, too.
        labels: number of label rows by class and blueprint, the ego's left out.
        lost_maps: ids of the episodes whose vector map is missing or damaged, if it was asked for.
    """

    problems: tuple[Problem, ...]
    whole: frozenset[str]
    damage: Mapping[str, Damage]
    labels: Mapping[tuple[str, str], int]
    agent_damage: Mapping[str, Mapping[str, Damage]]
    lost_maps: frozenset[str] = frozenset()

    @property
    def unknown_classes(self) -> dict[str, int]:
        """Classes of labels that no format knows, with their number of rows."""
        return self.rows_by_class(lambda name, _: name not in CLASSES)

    def rows_by_class(self, chosen: Callable[[str, str], bool]) -> dict[str, int]:
        """Number of rows by class, of those whose class and blueprint are chosen."""
        rows = Counter[str]()
        for (name, blueprint), number in self.labels.items():
            if chosen(name, blueprint):
                rows[name] += number
        return dict(sorted(rows.items()))

    @property
    def complete(self) -> bool:
        """Whether nothing is missing or damaged."""
        return not any(problem.severity == "error" for problem in self.problems)


def examine(
    dataset: Dataset,
    progress: Progress | None = None,
    *,
    with_agents: bool = False,
    with_maps: bool = False,
) -> Completeness:
    """Compare every committed file with its marker, and the ledger with what was asked for.

    Whether the data make sense is for ``carstage validate``.

    Args:
        dataset: the dataset.
        progress: called with (frames, frames in all).
        with_agents: also look at what agents beside the ego recorded.
        with_maps: also look at the vector maps of the towns.
    """
    problems: list[Problem] = []
    damage: dict[str, Damage] = {}
    agent_damage: dict[str, dict[str, Damage]] = defaultdict(dict)
    broken: set[str] = set()
    views = [v for e in dataset.episodes for v in (_views(e) if with_agents else (e,))]
    labels: Counter[tuple[str, str]] = Counter()
    whole: set[str] = set()
    maps = _VectorMaps()
    total, done = sum(view.frames for view in views), 0
    if not dataset.episodes:
        findings = Findings(None)
        findings.add("empty", "the dataset has no committed episode")
        problems += findings.problems()
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
        for episode in views:
            findings = Findings(episode.id, episode.agent_name if with_agents else None)
            changed = _changed_files(episode, threads, findings)
            is_whole = False
            try:
                if with_agents and episode.agent_name is not None:
                    agent_damage[episode.id][episode.agent_name] = _damage(episode, changed)
                else:
                    damage[episode.id] = _damage(episode, changed)
                ledger = episode.ledger()
                recorded = recorded_frames(episode.calibration.sensors, ledger)
                check_file_list(episode, recorded, findings)
                check_ledger(episode, ledger, findings)
                labels += _labels(episode)
                if not changed & {*DOCUMENTS, *TABLES}:
                    check_row_sensors(episode, ledger, recorded, findings)
                    if with_maps:
                        maps.check(episode, findings)
                    is_whole = True
            except CarStageError as error:
                findings.add("unreadable", str(error))
            (whole if is_whole else broken).add(episode.id)
            problems += findings.problems()
            done += episode.frames
            if progress is not None:
                progress(done, total)
    return Completeness(
        tuple(problems), frozenset(whole - broken), damage, labels, agent_damage, maps.lost
    )


class _VectorMaps:
    """Reads each map once, and reports it once, however many episodes name it."""

    def __init__(self) -> None:
        self._whole: dict[DatasetPath, bool] = {}
        self.lost: frozenset[str] = frozenset()

    def check(self, episode: Episode, findings: Findings) -> None:
        """The episode's map is there, and is what its name says."""
        path = episode.vector_map_file
        if path is None:
            return
        if path not in self._whole:
            self._whole[path] = True
            try:
                episode.vector_map()
            except DatasetError as error:
                self._whole[path] = False
                findings.add("vector_map", str(error))
        if not self._whole[path]:
            self.lost |= {episode.id}


def _views(episode: Episode) -> tuple[Episode, ...]:
    """The episode as the ego's and as each agent's; the former alone where it is not readable."""
    try:
        return episode.views
    except CarStageError:
        return (episode,)


def _changed_files(
    episode: Episode, threads: ThreadPoolExecutor, findings: Findings
) -> frozenset[str]:
    """Names of the files that are not what was committed."""
    changed = set()
    entries = episode.files
    for entry, problem in zip(
        entries, threads.map(lambda e: _difference(episode.folder, e), entries), strict=True
    ):
        if problem is not None:
            findings.add(*problem)
            changed.add(entry.path)
    return frozenset(changed)


def _difference(folder: DatasetPath, entry: FileEntry) -> tuple[str, str] | None:
    try:
        with os.fdopen(open_regular(folder / entry.path), "rb", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            if size != entry.bytes:
                return "file_size", f"{entry.path} has {size} bytes, committed were {entry.bytes}"
            found, size = hash_of_file(file, entry.hash)
    except FileNotFoundError:
        return "file_missing", f"{entry.path} is missing"
    except OSError as error:
        return "file_missing", f"{entry.path} cannot be read: {error.strerror}"
    if size != entry.bytes:
        return "file_size", f"{entry.path} has {size} bytes, committed were {entry.bytes}"
    if found != entry.hash:
        return "file_hash", f"{entry.path} is not the file that was committed"
    return None


def _damage(episode: Episode, changed: frozenset[str]) -> Damage:
    """What the files are of: sensors and frames, and labels by the names of their files."""
    listed = {entry.path for entry in episode.files} - changed
    damage = {(name, k) for name, k in label_files(episode).items() if name not in listed}
    for sensor in episode.sensors:
        for k in range(episode.frames):
            if not listed.issuperset(sensor.file_names(k)):
                damage.add((sensor.id, k))
    return frozenset(damage)


def _labels(episode: Episode) -> Counter[tuple[str, str]]:
    objects = episode.objects()
    others = objects.filter(pc.invert(objects["is_ego"])).select(["class", "blueprint"])
    counted = others.group_by(["class", "blueprint"]).aggregate([([], "count_all")])
    columns = (counted[name].to_pylist() for name in ("class", "blueprint", "count_all"))
    return Counter({(str(name), str(kind)): int(n) for name, kind, n in zip(*columns, strict=True)})
