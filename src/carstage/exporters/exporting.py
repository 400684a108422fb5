"""Run an exporter over a dataset: frames in parallel, parts in order, the folder at the end."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from carstage import __version__
from carstage.dataset import Dataset, Episode
from carstage.dataset.saved_frames import Damage, EpisodeFrames
from carstage.errors import BadInputError, ExportError
from carstage.exporters.class_map import ClassMap
from carstage.exporters.classes import CLASSES
from carstage.exporters.completeness import Completeness, Progress, examine
from carstage.exporters.exporter import Exporter, FrameWriter, exporter_for
from carstage.exporters.options import ExportOptions
from carstage.exporters.remote_target import check_remote_target, remote_folder
from carstage.exporters.splits import ExportSplits, Split, splits_of_export
from carstage.exporters.target import check_target, export_folder, write_document
from carstage.exporters.variants import episode_entries
from carstage.lazy import keep_pandas_lazy
from carstage.processes import process_pool
from carstage.storage import DatasetPath, RemotePath, dataset_root
from carstage.storage.marker import CommitMarker
from carstage.validation import Problem

_IN_FLIGHT_PER_WORKER = 4
_MOST_LISTED = 10


@dataclass(frozen=True, slots=True)
class ExportSummary:
    """What an export holds.

    Attributes:
        path: its folder.
        format: name of the format.
        episodes: number of episodes.
        frames: number of frames.
        frames_left_out: frames whose data the format cannot do without were missing.
        episodes_left_out: ids of the episodes whose tables were missing or damaged.
        unknown_classes: rows by class of the labels that were left out as no format knows them.
        classes_left_out: rows by class of the labels that the class map, or COCO's categories,
            have no target for.
        splits: number of episodes by split, of formats that have splits.
        warnings: what the user has to know, a sentence or two each.
        sensors_left_out: frames by sensor whose data the format has no place for, where it says so.
        problems: what is missing or damaged in the dataset.
    """

    path: DatasetPath
    format: str
    episodes: int
    frames: int
    frames_left_out: int
    episodes_left_out: tuple[str, ...]
    unknown_classes: dict[str, int]
    classes_left_out: dict[str, int]
    splits: dict[Split, int]
    warnings: tuple[str, ...]
    sensors_left_out: dict[str, int]
    problems: tuple[Problem, ...]

    def to_json(self) -> dict[str, Any]:
        """The summary, without the problems, as a JSON object."""
        document = asdict(self)
        del document["problems"]
        return {**document, "path": str(self.path)}


Phase = Literal["Checking", "Exporting"]


def export_dataset(
    format_name: str,
    dataset: str | DatasetPath,
    out: str | DatasetPath,
    options: ExportOptions | None = None,
    *,
    overwrite: bool = False,
    allow_incomplete: bool = False,
    workers: int | None = None,
    progress: Callable[[Phase, int, int], object] | None = None,
) -> ExportSummary:
    """Write a dataset in another format; first every file is compared with its hash.

    Args:
        format_name: one of ``exporters()``, such as ``coco``, ``kitti-object`` or ``nuscenes``.
        dataset: folder of the dataset, or its place in an object store.
        out: the folder to make, or a place in an object store; it is there when all is written.
        options: choices; default: those of the format.
        overwrite: replace an export that stands there.
        allow_incomplete: leave frames, files and episodes out that are missing or damaged.
        workers: number of processes; 0: none but this one; default: the number of CPU cores.
        progress: called with what is done, frames done, frames in all.

    Returns:
        What was written, and what was found missing or damaged.

    Raises:
        BadInputError: unfit options, rig or folder, or the dataset is incomplete.
        DatasetError: the folder is no dataset.
        ExportError: a worker died.

    Example:
        >>> import carstage
        >>> options = carstage.ExportOptions(cameras=("CAM_FRONT",), max_distance_m=50.0)
        >>> carstage.export("coco", "datasets/demo", "exports/coco", options).frames
        50
    """
    source, target = Dataset(dataset), dataset_root(out)
    exporter = exporter_for(format_name, options or ExportOptions())
    _check_target(target, source.path, overwrite=overwrite)
    chosen = _chosen(source, exporter.options)
    found = _examined(chosen, exporter, _of_phase("Checking", progress))
    if not found.complete and not allow_incomplete:
        raise BadInputError(_refusal(found), "Repair it, or add --allow-incomplete.")
    episodes = tuple(episode for episode in chosen.episodes if episode.id in found.whole)
    if not episodes:
        raise BadInputError(
            f"The dataset {source.path} has no whole episode.", "Record one: carstage run."
        )
    splits = _splits(source, episodes, exporter)
    exporter.splits, exporter.lost_maps = splits.episodes, found.lost_maps
    with _new_folder(target) as folder:
        frames = _write(
            exporter, episodes, folder, found, workers, _of_phase("Exporting", progress)
        )
        summary = ExportSummary(
            path=target,
            format=format_name,
            episodes=len(episodes),
            frames=frames,
            frames_left_out=sum(episode.frames for episode in episodes) - frames,
            episodes_left_out=tuple(e.id for e in chosen.episodes if e.id not in found.whole),
            unknown_classes=found.unknown_classes,
            classes_left_out=_without_target(found, exporter.options.class_map),
            splits=splits.counts,
            warnings=(*splits.warnings, *_lost_maps(episodes, found)),
            sensors_left_out=dict(sorted(exporter.sensors_left_out.items())),
            problems=found.problems,
        )
        write_document(
            folder,
            {
                **{key: value for key, value in summary.to_json().items() if key != "path"},
                "created_by": f"carstage {__version__}",
                "dataset": source.name,
                **episode_entries(episodes),
                "options": asdict(exporter.options),
            },
        )
    return summary


def _chosen(source: Dataset, options: ExportOptions) -> Dataset:
    """The episodes that the options name, as those of the agent that they name.

    Raises:
        BadInputError: there is no such episode, variant or agent.
    """
    chosen = source.only(options.episodes)
    if options.variant is not None:
        chosen = chosen.as_variant(options.variant)
    return chosen if options.agent is None else chosen.as_agent(options.agent)


def _examined(chosen: Dataset, exporter: Exporter, progress: Progress | None) -> Completeness:
    """What the dataset lacks of all that the format may write."""
    return examine(chosen, progress, with_agents=exporter.with_agents, with_maps=exporter.with_maps)


def _check_target(out: DatasetPath, dataset: DatasetPath, *, overwrite: bool) -> None:
    if isinstance(out, RemotePath):
        check_remote_target(out, dataset, overwrite=overwrite)
    else:
        check_target(out, dataset, overwrite=overwrite)


def _new_folder(out: DatasetPath) -> AbstractContextManager[Path]:
    return remote_folder(out) if isinstance(out, RemotePath) else export_folder(out)


def _splits(dataset: Dataset, episodes: Sequence[Episode], exporter: Exporter) -> ExportSplits:
    """The splits, of formats that have some."""
    if "val_share" not in exporter.uses:
        return ExportSplits({}, ())
    return splits_of_export(dataset, episodes, exporter.options)


def _without_target(found: Completeness, class_map: ClassMap | None) -> dict[str, int]:
    if class_map is None:
        return {}
    return found.rows_by_class(
        lambda name, blueprint: name in CLASSES and class_map.target(name, blueprint) is None
    )


def _lost_maps(episodes: Sequence[Episode], found: Completeness) -> tuple[str, ...]:
    lost = (episode for episode in episodes if episode.id in found.lost_maps)
    towns = {Path(episode.document["map"]).name for episode in lost}
    return tuple(f"A vector map of {town} is lost; it was left out." for town in sorted(towns))


def _of_phase(
    phase: Phase, progress: Callable[[Phase, int, int], object] | None
) -> Progress | None:
    return None if progress is None else partial(progress, phase)


def _refusal(found: Completeness) -> str:
    errors = [problem for problem in found.problems if problem.severity == "error"]
    lines = [
        f"  {problem.episode or 'dataset'}: {problem.message}" for problem in errors[:_MOST_LISTED]
    ]
    if len(errors) > _MOST_LISTED:
        lines.append(f"  and {len(errors) - _MOST_LISTED} more; see carstage validate")
    return "\n".join(["The dataset is incomplete or damaged:", *lines])


def _write(
    exporter: Exporter,
    episodes: Sequence[Episode],
    folder: Path,
    found: Completeness,
    workers: int | None,
    progress: Progress | None,
) -> int:
    """Number of frames that were written."""
    total, done, written = sum(episode.frames for episode in episodes), 0, 0
    with ExitStack() as stack:
        pool = None if workers == 0 else stack.enter_context(_pool(workers, exporter))
        stack.callback(_frames_of.cache_clear)
        stack.callback(exporter.close)
        exporter.begin(episodes, folder)
        for episode in episodes:
            writer = exporter.begin_episode(episode)
            task = _EpisodeTask(
                episode.folder,
                episode.id,
                episode.marker.attempt,
                episode.frames,
                found.damage.get(episode.id, frozenset()),
                episode.agent_name,
                tuple(found.agent_damage.get(episode.id, {}).items()),
            )
            for part in _parts(pool, workers, task, writer, folder):
                if part is not None:
                    exporter.add(part)
                    written += 1
                done += 1
                if progress is not None:
                    progress(done, total)
            exporter.end_episode()
        exporter.finish()
    return written


@contextmanager
def _pool(workers: int | None, exporter: Exporter) -> Iterator[Executor]:
    pool = process_pool(workers, preload=(load_format, (type(exporter).__module__,)))
    try:
        yield pool
    except BrokenExecutor as error:
        raise ExportError(
            "A process that wrote frames died.", "Is there memory enough? Try --workers 1."
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def load_format(module: str) -> None:
    """Import what writes frames, in the process that those are forked from that do.

    It starts no thread. What is not of this package may start some, and is imported after the fork.
    """
    if module.startswith(f"{__package__}."):
        import_module(module)
    keep_pandas_lazy()


@dataclass(frozen=True, slots=True)
class _EpisodeTask:
    """An episode as workers get it: without its list of files."""

    folder: DatasetPath
    episode_id: str
    attempt: str
    frames: int
    damage: Damage
    agent: str | None
    agent_damage: tuple[tuple[str, Damage], ...]


def _parts(
    pool: Executor | None,
    workers: int | None,
    task: _EpisodeTask,
    writer: FrameWriter,
    folder: Path,
) -> Iterator[Any]:
    """What the writer returns, in the order of the frames; few frames are on their way at once."""
    if pool is None:
        for k in range(task.frames):
            yield _write_frame(task, k, writer, folder)
        return
    most = _IN_FLIGHT_PER_WORKER * (workers or len(os.sched_getaffinity(0)))
    waiting: deque[Future[Any]] = deque()
    for k in range(task.frames):
        waiting.append(pool.submit(_write_frame, task, k, writer, folder))
        if len(waiting) >= most:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _write_frame(task: _EpisodeTask, k: int, writer: FrameWriter, folder: Path) -> Any:
    return writer(_frames_of(task).frame(k), folder)


@lru_cache(maxsize=1)
def _frames_of(task: _EpisodeTask) -> EpisodeFrames:
    """An episode's tables, read once by each process."""
    marker = CommitMarker(task.episode_id, task.attempt, task.frames, (), {})
    episode = Episode(task.folder, marker, task.agent)
    episode.agent_damage = dict(task.agent_damage)
    return EpisodeFrames(episode, task.damage)
