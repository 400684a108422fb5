"""Datasets and their episodes as lists: from the small documents alone, read once each."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from carstage.errors import CarStageError
from carstage.runs.reading import liveness, read_document
from carstage.storage.description import read_description
from carstage.storage.keeping import remove_dataset, rename_dataset
from carstage.storage.marker import read_marker
from carstage.storage.remote_path import DatasetPath
from carstage.web.archive import zipped
from carstage.web.datasets.episode_index import EpisodeFacts, EpisodeIndex
from carstage.web.datasets.jobs import JobService
from carstage.web.errors import WebError, not_found
from carstage.web.found_dataset import FoundDataset
from carstage.web.messages import (
    DatasetDetail,
    DatasetList,
    DatasetSummary,
    EpisodeSummary,
)
from carstage.web.messages.datasets import Tag
from carstage.web.roots import Roots

if TYPE_CHECKING:
    from carstage.dataset import Episode

_MOST_LISTED = 500
_AT_ONCE = 16

Argument = TypeVar("Argument")
Result = TypeVar("Result")


class Catalogue:
    """The datasets below the roots; safe to use from several threads.

    Args:
        roots: where they are.
        jobs: knows which of them are valid.
        index: knows what lists say of episodes.
    """

    def __init__(self, roots: Roots, jobs: JobService, index: EpisodeIndex) -> None:
        self._roots = roots
        self._jobs = jobs
        self._index = index
        self._lock = threading.Lock()
        self._kept: dict[str, tuple[str, list[EpisodeSummary]]] = {}

    def all(self) -> DatasetList:
        """All datasets, the one that has changed last first."""
        found = list(self._roots.datasets().values())[:_MOST_LISTED]
        summaries = [self._summary(dataset) for dataset in found]
        self._index.save()
        summaries.sort(key=lambda dataset: (-(dataset.changed or 0.0), dataset.dataset))
        return DatasetList(
            datasets=summaries,
            root=str(self._roots.roots[0]),
            disk_free_bytes=self._roots.free_bytes(),
            problems=self._roots.problems(),
        )

    def detail(self, dataset: str) -> DatasetDetail:
        """A dataset with its episodes.

        Raises:
            WebError: there is none of that id.
            DatasetError: it cannot be read.
        """
        from carstage.report.drawing import CLASS_COLOURS

        found = self._roots.dataset(dataset)
        episodes = self.summaries(dataset)
        self._index.save()
        return DatasetDetail(
            summary=self._summary(found),
            episodes=episodes,
            tags=self.tags(dataset),
            class_colours={name: list(colour) for name, colour in CLASS_COLOURS.items()},
        )

    def tags(self, dataset: str) -> list[Tag]:
        """The semantic tags of a dataset.

        Raises:
            WebError: there is none of that id.
            DatasetError: it cannot be read.
        """
        description = read_description(self._roots.dataset(dataset).path / "dataset.json")
        return [Tag.model_validate(tag) for tag in description.get("tags", ())]

    def episode(self, dataset: str, episode: str) -> Episode:
        """One committed episode.

        Raises:
            WebError: there is none of that id.
            DatasetError: its marker is damaged.
        """
        from carstage.dataset import Episode

        found = self._roots.dataset(dataset)
        changed_s = found.markers().get(episode)
        if changed_s is None:
            raise not_found(f"episode {episode} in this dataset")
        return _episode(Episode, found.path / "commits" / f"{episode}.json", changed_s)

    def episodes(self, dataset: str) -> list[Episode]:
        """All committed episodes, sorted by id.

        Raises:
            WebError: there is no such dataset.
        """
        from carstage.dataset import Episode

        found = self._roots.dataset(dataset)

        def one(entry: tuple[str, float]) -> Episode:
            name, changed_s = entry
            return _episode(Episode, found.path / "commits" / f"{name}.json", changed_s)

        return _each(found, one, found.markers().items())

    def numbered(self, dataset: str, episode: str) -> EpisodeSummary:
        """An episode with its number in the dataset.

        Raises:
            WebError: there is none of that id.
        """
        for summary in self.summaries(dataset):
            if summary.episode_id == episode:
                return summary
        raise not_found(f"episode {episode} in this dataset")

    def summaries(self, dataset: str) -> list[EpisodeSummary]:
        """All episodes in a few figures, in their order; kept while none comes or goes.

        Raises:
            WebError: there is no such dataset.
            DatasetError: a document of an episode is damaged.
        """
        found = self._roots.dataset(dataset)
        now = found.fingerprint()
        with self._lock:
            kept = self._kept.get(found.dataset)
        if kept is not None and kept[0] == now:
            return kept[1]
        facts = sorted(self._facts(found), key=lambda one: (one.index, one.episode_id))
        numbered = [_summary_of(one, number) for number, one in enumerate(facts, 1)]
        with self._lock:
            self._kept[found.dataset] = now, numbered
        return numbered

    def _facts(self, found: FoundDataset) -> list[EpisodeFacts]:
        def one(entry: tuple[str, float]) -> EpisodeFacts:
            name, changed_s = entry
            return self._index.facts(found.path / "commits" / f"{name}.json", changed_s)

        return _each(found, one, found.markers().items())

    def rename(self, dataset: str, name: str) -> DatasetSummary:
        """Give a dataset another name; its folder stays.

        Raises:
            WebError: there is no such dataset.
            BadInputError: the name cannot be used.
            DatasetError: it is none.
        """
        found = self._roots.dataset(dataset)
        rename_dataset(found.path, name)
        return self._summary(found)

    def remove(self, dataset: str, *, busy: bool) -> list[str]:
        """Remove a dataset with its runs.

        Args:
            dataset: its id.
            busy: whether a run writes into it.

        Returns:
            Names of what stays in its folder.

        Raises:
            WebError: there is no such dataset, or somebody uses it.
            StorageError: something cannot be removed.
        """
        found = self._roots.dataset(dataset)
        if busy or _records(found):
            raise WebError(409, "A run records into this dataset.", "Stop it first.")
        if self._jobs.uses(dataset):
            raise WebError(409, "An export or a validation reads it.", "Wait, or cancel it.")
        left = remove_dataset(found.path)
        self._jobs.forget(found)
        self._roots.forget()
        return left

    def archive(self, dataset: str) -> Iterator[bytes]:
        """A dataset as a ZIP archive: what its markers list, without runs.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        return zipped((f"{found.path.name}/{name}", p) for name, p in self._files(found))

    def _files(self, found: FoundDataset) -> Iterator[tuple[str, DatasetPath]]:
        for name in ("dataset.json", "splits.json"):
            if (found.path / name).is_file():
                yield name, found.path / name
        maps: set[DatasetPath] = set()
        for episode in self.episodes(found.dataset):
            inside = f"episodes/{episode.id}/{episode.marker.attempt}"
            for entry in episode.marker.files:
                yield f"{inside}/{entry.path}", episode.folder / entry.path
            for path in (episode.map_file, episode.vector_map_file):
                if path is not None and path not in maps:
                    maps.add(path)
                    yield f"maps/{path.name}", path
            marker = found.path / "commits" / f"{episode.id}.json"
            yield f"commits/{marker.name}", marker  # last: what is broken off is no episode

    def _summary(self, found: FoundDataset) -> DatasetSummary:
        changed = None
        try:
            name = str(read_description(found.path / "dataset.json").get("name", found.shown))
            facts = self._facts(found)
            changed = found.changed()
        except (CarStageError, OSError) as error:
            reason = error.message if isinstance(error, CarStageError) else "It cannot be read."
            return DatasetSummary(
                dataset=found.dataset,
                name=found.shown,
                path=found.shown,
                state="damaged",
                problem=reason.replace(str(found.path), found.shown),
                location=str(found.path),
            )
        state = "recording" if _records(found) else "ready" if facts else "empty"
        return DatasetSummary(
            dataset=found.dataset,
            name=name,
            path=found.shown,
            state=state,  # type: ignore[arg-type]
            episodes=len(facts),
            frames=sum(one.frames for one in facts),
            bytes=sum(one.bytes for one in facts),
            changed=changed,
            validity=self._jobs.validity(found),  # type: ignore[arg-type]
            location=str(found.path),
        )


def _each(
    found: FoundDataset, function: Callable[[Argument], Result], arguments: Iterable[Argument]
) -> list[Result]:
    """A function of each; in a store several at a time, as each waits for an answer."""
    if not found.is_remote:
        return [function(argument) for argument in arguments]
    with ThreadPoolExecutor(_AT_ONCE) as threads:
        return list(threads.map(function, arguments))


def _records(found: FoundDataset) -> bool:
    """Whether a run of this machine writes to a dataset now."""
    from carstage.runs.preflight import work_folder

    runs = work_folder(found.path, None) / "runs"
    newest = sorted(runs.glob("*/status.json"))[-3:]
    statuses = (read_document(path) for path in newest)
    return any(s is not None and liveness(s) in ("running", "stalled") for s in statuses)


def _summary_of(facts: EpisodeFacts, number: int) -> EpisodeSummary:
    return EpisodeSummary(
        episode_id=facts.episode_id,
        index=facts.index,
        map=facts.map,
        weather=facts.weather,
        frames=facts.frames,
        saved_fps=facts.saved_fps,
        duration_s=facts.duration_s,
        bytes=facts.bytes,
        sensors=facts.sensors,
        thumbnail=facts.thumbnail or None,
        number=number,
    )


@lru_cache(maxsize=64)
def _episode(kind: type[Episode], marker_path: DatasetPath, _changed_s: float) -> Episode:
    """An episode, kept with what it has read as long as its marker stays the same."""
    marker = read_marker(marker_path)
    dataset = marker_path.parent.parent
    return kind(dataset / "episodes" / marker.episode_id / marker.attempt, marker)
