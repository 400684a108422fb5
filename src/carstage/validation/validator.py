"""Recompute from the files whether a dataset is what it says it is."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from carstage.dataset.collection import Dataset
from carstage.dataset.reading import Episode
from carstage.dataset.variants import EpisodeVariants, variants_of
from carstage.errors import CarStageError
from carstage.storage.remote_path import DatasetPath
from carstage.validation.checks.catalogue import RULES
from carstage.validation.checks.figures import Figures, FrameFigures
from carstage.validation.checks.findings import Findings, Problem, Severity
from carstage.validation.checks.fleet import check_fleet
from carstage.validation.checks.frames import conclude
from carstage.validation.checks.maps import MapChecks
from carstage.validation.checks.messages import check_messages
from carstage.validation.checks.patch_pairs import check_patch_pairs
from carstage.validation.checks.pictures import check_repeated_episodes
from carstage.validation.checks.population import check_population
from carstage.validation.checks.splits import check_splits
from carstage.validation.checks.tag_images import check_tag_table
from carstage.validation.checks.variants import check_variants
from carstage.validation.checks.vector_maps import VectorMapChecks
from carstage.validation.sharing import FRAMES, Checked, shared

REPORT_FORMAT = 1


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """The verdict over a dataset.

    Attributes:
        problems: everything that was found, in the order of the episodes; of one kind in one
            episode the first 25.
        counts: number of errors and warnings by check, those that are not listed too; every check
            of the catalogue is there.
        figures: what was measured: numbers of episodes, frames, files and bytes; ``hull``: pixels
            of objects and how many lie outside their box; ``lidar_depth``: by pair of LiDAR and
            depth camera, points compared and the share that agrees; ``lidar_points_in_boxes``;
            ``rgb_edges``: by camera, how much steeper the image is where labels change;
            ``rgb_frame``: the same against the labels of the frame before (-1) and after (1);
            ``flow``: by camera, pixels compared and the share that agrees; ``motion``: steps of
            objects, likewise; ``pictures``: by camera, images and how many show nothing;
            ``labels``: counts; ``variants``: episodes in variants, poses compared, and how far they
            lie apart at most; ``patch_pairs``: pictures with and without patches, and
            pixels outside of these that differ.
    """

    problems: tuple[Problem, ...]
    counts: Mapping[str, Mapping[Severity, int]]
    figures: Mapping[str, Any]

    @property
    def ok(self) -> bool:
        """Whether no problem is an error."""
        return not any(problem.severity == "error" for problem in self.problems)

    def to_json(self) -> str:
        """The report as one JSON object on one line."""
        return json.dumps(
            {
                "format_version": REPORT_FORMAT,
                "ok": self.ok,
                "problems": [asdict(problem) for problem in self.problems],
                "checks": {
                    name: {"rule": rule, **self.counts[name]} for name, rule in RULES.items()
                },
                "figures": self.figures,
            }
        )


def _views(episode: Episode) -> tuple[Episode, ...]:
    """The episode as the ego's and as each agent's; the former alone where it is not readable."""
    try:
        return episode.views
    except CarStageError:
        return (episode,)


def _variants(dataset: Dataset) -> tuple[EpisodeVariants, ...]:
    """The variants of episodes, of those whose document can be read."""
    readable = []
    for episode in dataset.episodes:
        try:
            is_variant = episode.variant is not None
        except CarStageError:
            continue  # the checks of its files say so
        if is_variant:
            readable.append(episode)
    return variants_of(readable)


class _Bar:
    """How far it is, told after each task."""

    def __init__(self, show: Callable[[int, int], None] | None, total: int) -> None:
        self._show, self._total = show, total
        self._done = 0

    def advance(self, frames: int) -> None:
        self._done += frames
        if frames and self._show is not None:
            self._show(self._done, self._total)


def _check_view(view: Episode, results: Iterator[Checked], figures: Figures, bar: _Bar) -> Findings:
    """What all tasks of an episode found, as if it had been one."""
    findings = Findings(view.id, view.agent_name)
    of_frames = FrameFigures()
    unreadable: str | None = None
    for first in (None, *range(0, view.frames, FRAMES)):
        found = next(results)
        bar.advance(0 if first is None else min(FRAMES, view.frames - first))
        if unreadable is not None:
            continue  # nothing can be said, whatever the frames are
        findings.include(found.findings)
        unreadable = found.unreadable
        if found.tables is not None:
            figures.add_tables(found.tables)
        if found.frames is not None:
            of_frames.add(found.frames)
    if unreadable is None:
        try:
            figures.not_decidable += conclude(view, of_frames, findings)
        except CarStageError as error:
            unreadable = str(error)
    if unreadable is not None:
        findings.add("unreadable", unreadable)
    figures.add_frames(of_frames)
    # An episode's frames count once, however many agents look at them.
    figures.frames += view.frames if view.agent_name is None else 0
    return findings


def validate_dataset(
    path: str | DatasetPath,
    *,
    progress: Callable[[int, int], None] | None = None,
    workers: int | None = None,
) -> ValidationReport:
    """Check every committed episode; what is not committed is not looked at.

    What is checked, and how, stands in ``checks.catalogue``, in the modules beside it and in
    ``docs/formats/dataset.md``.

    Args:
        path: folder of the dataset, or its place in an object store.
        progress: called with (frames checked, frames in all) after every few frames.
        workers: processes that look at frames; the verdict is the same for any number. 0: none but
            this one; default: one for each core that may be used, and none for few frames.

    Raises:
        DatasetError: the folder is no dataset, of another format version, or a marker is damaged.
        WorkerLostError: one of the processes died.
    """
    dataset = Dataset(path)
    views = [view for episode in dataset.episodes for view in _views(episode)]
    figures = Figures()
    everything: list[Findings] = []
    maps, vector_maps = MapChecks(), VectorMapChecks()
    bar = _Bar(progress, sum(view.frames for view in views))
    with shared(views, workers) as results:
        for view in views:
            # Before the first of its results is awaited.
            of_maps = Findings(view.id, view.agent_name)
            maps.check(view, of_maps)
            vector_maps.check(view, of_maps)
            everything += [_check_view(view, results, figures, bar), of_maps]
    for episode in dataset.episodes:
        findings = Findings(episode.id)
        everything.append(findings)
        check_fleet(episode, findings)
        check_messages(episode, findings)
    for variants in _variants(dataset):
        findings = Findings(next(iter(variants.episodes.values())).id)
        everything.append(findings)
        check_variants(variants, findings, figures.variants)
        check_patch_pairs(variants, findings, figures.patch_pairs)
    findings = Findings(None)
    everything.append(findings)
    if not dataset.episodes:
        findings.add("empty", "the dataset has no committed episode")
    check_splits(dataset, findings)
    check_tag_table(dataset.description, findings)
    check_repeated_episodes(dataset.episodes, findings)
    check_population(figures.population, findings)
    counts: dict[str, dict[Severity, int]] = {name: {"error": 0, "warning": 0} for name in RULES}
    for findings in everything:
        findings.count(counts)
    problems = tuple(problem for findings in everything for problem in findings.problems())
    return ValidationReport(problems, counts, figures.to_dict(len(dataset.episodes)))
