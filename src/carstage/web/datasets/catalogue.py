"""Datasets and their episodes as lists: from the small documents alone, read once each."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from carstage.errors import CarStageError
from carstage.runs.reading import liveness, read_document
from carstage.storage.description import read_description
from carstage.storage.marker import read_marker
from carstage.web.datasets.episode_index import EpisodeFacts, EpisodeIndex
from carstage.web.datasets.jobs import JobService
from carstage.web.errors import not_found
from carstage.web.messages import (
    DatasetDetail,
    DatasetList,
    DatasetSummary,
    EpisodeSummary,
)
from carstage.web.messages.datasets import Tag
from carstage.web.roots import FoundDataset, Roots

if TYPE_CHECKING:
    from carstage.dataset import Episode

_MOST_LISTED = 500


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
        )

    def detail(self, dataset: str) -> DatasetDetail:
        """A dataset with its episodes.

        Raises:
            WebError: there is none of that id.
            DatasetError: it cannot be read.
        """
        from carstage.report.drawing import CLASS_COLOURS

        found = self._roots.dataset(dataset)
        facts = self._facts(found)
        self._index.save()
        return DatasetDetail(
            summary=self._summary(found),
            episodes=[_summary_of(one) for one in facts],
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

    def number(self, dataset: str, episode_id: str) -> int:
        """The place of an episode in its dataset, from 1, in the order of :meth:`detail`.

        Raises:
            WebError: there is no such dataset or episode.
            DatasetError: a marker is damaged.
        """
        order = [facts.episode_id for facts in self._facts(self._roots.dataset(dataset))]
        if episode_id not in order:
            raise not_found(f"episode {episode_id} in this dataset")
        return 1 + order.index(episode_id)

    def episode(self, dataset: str, episode: str) -> Episode:
        """One committed episode.

        Raises:
            WebError: there is none of that id.
            DatasetError: its marker is damaged.
        """
        from carstage.dataset import Episode

        found = self._roots.dataset(dataset)
        marker = found.path / "commits" / f"{episode}.json"
        try:
            changed_ns = marker.stat().st_mtime_ns
        except OSError:
            raise not_found(f"episode {episode} in this dataset") from None
        return _episode(Episode, marker, changed_ns)

    def episodes(self, dataset: str) -> list[Episode]:
        """All committed episodes, sorted by id.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        return [self.episode(dataset, episode) for episode in _ids(found.path)]

    def episode_summary(self, episode: Episode) -> EpisodeSummary:
        """An episode in a few figures.

        Raises:
            DatasetError: a document of it is damaged.
        """
        dataset = episode.folder.parents[2]
        return _summary_of(self._index.facts(Path(str(dataset / "commits" / f"{episode.id}.json"))))

    def _facts(self, found: FoundDataset) -> list[EpisodeFacts]:
        """Of all episodes, in the order in which they are numbered."""
        facts = [self._index.facts(marker) for marker in _markers(found.path)]
        return sorted(facts, key=lambda one: (one.index, one.episode_id))

    def _summary(self, found: FoundDataset) -> DatasetSummary:
        changed = None
        try:
            name = str(read_description(found.path / "dataset.json").get("name", found.shown))
            facts = [self._index.facts(path) for path in _markers(found.path)]
            changed = (found.path / "commits").stat().st_mtime
        except (CarStageError, OSError) as error:
            reason = error.message if isinstance(error, CarStageError) else "It cannot be read."
            return DatasetSummary(
                dataset=found.dataset,
                name=found.shown,
                path=found.shown,
                state="damaged",
                problem=reason.replace(str(found.path), found.shown),
            )
        state = "recording" if _records(found.path) else "ready" if facts else "empty"
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
        )


def _markers(dataset: Path) -> list[Path]:
    return sorted(
        path for path in (dataset / "commits").glob("*.json") if not path.name.startswith(".")
    )


def _ids(dataset: Path) -> list[str]:
    return [path.stem for path in _markers(dataset)]


def _records(dataset: Path) -> bool:
    """Whether a run writes to a dataset now."""
    newest = sorted((dataset / "runs").glob("*/status.json"))[-3:]
    statuses = (read_document(path) for path in newest)
    return any(s is not None and liveness(s) in ("running", "stalled") for s in statuses)


def _summary_of(facts: EpisodeFacts) -> EpisodeSummary:
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
    )


@lru_cache(maxsize=64)
def _episode(kind: type[Episode], marker_path: Path, _changed_ns: int) -> Episode:
    """An episode, kept with what it has read as long as its marker stays the same."""
    marker = read_marker(marker_path)
    dataset = marker_path.parent.parent
    return kind(dataset / "episodes" / marker.episode_id / marker.attempt, marker)
