"""Datasets and their episodes as lists: from the small documents alone, read once each."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from carstage.errors import CarStageError
from carstage.runs.reading import liveness, read_document
from carstage.storage.description import read_description
from carstage.storage.marker import read_marker
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
    """

    def __init__(self, roots: Roots, jobs: JobService) -> None:
        self._roots = roots
        self._jobs = jobs

    def all(self) -> DatasetList:
        """All datasets, the one that has changed last first."""
        found = list(self._roots.datasets().values())[:_MOST_LISTED]
        summaries = [self._summary(dataset) for dataset in found]
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
        episodes = [self.episode_summary(self.episode(dataset, id_)) for id_ in _ids(found.path)]
        return DatasetDetail(
            summary=self._summary(found),
            episodes=sorted(episodes, key=lambda episode: (episode.index, episode.episode_id)),
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
        order = [(e.spec.index, e.id) for e in self.episodes(dataset)]
        own = self.episode(dataset, episode_id)
        return 1 + sorted(order).index((own.spec.index, own.id))

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
        """An episode in a few figures."""
        spec = episode.spec
        return EpisodeSummary(
            episode_id=episode.id,
            index=spec.index,
            map=spec.map,
            weather=spec.weather.preset or "own values",
            frames=episode.frames,
            saved_fps=spec.saved_fps,
            duration_s=spec.duration_s,
            bytes=sum(entry.bytes for entry in episode.marker.files),
            sensors=len(spec.written_sensors),
        )

    def _summary(self, found: FoundDataset) -> DatasetSummary:
        changed = None
        try:
            name = str(read_description(found.path / "dataset.json").get("name", found.shown))
            markers = [_marker(path, path.stat().st_mtime_ns) for path in _markers(found.path)]
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
        state = "recording" if _records(found.path) else "ready" if markers else "empty"
        return DatasetSummary(
            dataset=found.dataset,
            name=name,
            path=found.shown,
            state=state,  # type: ignore[arg-type]
            episodes=len(markers),
            frames=sum(frames for frames, _ in markers),
            bytes=sum(size for _, size in markers),
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


@lru_cache(maxsize=20_000)
def _marker(path: Path, _changed_ns: int) -> tuple[int, int]:
    """Frames and bytes of an episode."""
    marker = read_marker(path)
    return marker.frames, sum(entry.bytes for entry in marker.files)


@lru_cache(maxsize=64)
def _episode(kind: type[Episode], marker_path: Path, _changed_ns: int) -> Episode:
    """An episode, kept with what it has read as long as its marker stays the same."""
    marker = read_marker(marker_path)
    dataset = marker_path.parent.parent
    return kind(dataset / "episodes" / marker.episode_id / marker.attempt, marker)
