"""Composes the report: pictures first, then maps, statistics and the verdict."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path

from carstage import __version__
from carstage.dataset.collection import Dataset
from carstage.files.whole import write_whole
from carstage.report import html
from carstage.report.coverage import (
    coverage_section,
    positions_section,
    weather_name,
)
from carstage.report.drawing import class_colour
from carstage.report.episodes import (
    EpisodePictures,
    episode_section,
    frames_per_second,
    showcase,
)
from carstage.report.film import require_video
from carstage.report.statistics import (
    DISTANCE_EDGES_M,
    LIDAR_EDGES,
    OCCLUSION_NAMES,
    LabelStatistics,
    bin_names,
    count_labels,
)
from carstage.report.verdict import badge, validation_section
from carstage.storage import DatasetPath, RemotePath
from carstage.validation.validator import ValidationReport, validate_dataset

MOST_EPISODES_WITH_PICTURES = 6
_MOST_THREADS = 4


def write_report(
    path: str | DatasetPath,
    out: Path | None = None,
    *,
    validation: ValidationReport | None = None,
    films: bool = False,
) -> Path:
    """Write one self-contained HTML page about a dataset.

    Args:
        path: folder of the dataset.
        out: the file to write; default: ``report.html`` in the dataset's folder.
        validation: the verdict to show; without one the dataset is validated first.
        films: add a film with boxes of each labelled colour camera (extra ``video``).

    Returns:
        The file written.

    Raises:
        DatasetError: the folder is no dataset, or its tables cannot be read.
        BadInputError: films are wanted, and the extra is not installed.
    """
    if films:
        require_video()
    dataset = Dataset(path)
    episodes = dataset.episodes
    # Pictures are drawn while the dataset is validated: most of both leaves the interpreter's lock.
    with ThreadPoolExecutor(
        max(1, min(_MOST_THREADS, os.cpu_count() or 1)), thread_name_prefix="report"
    ) as pool:
        drawn = [
            pool.submit(_drawn, dataset, number, films=films)
            for number in range(min(len(episodes), MOST_EPISODES_WITH_PICTURES))
        ]
        covered = pool.submit(coverage_section, episodes) if episodes else None
        around = pool.submit(positions_section, episodes)
        counted = pool.submit(count_labels, episodes)
        try:
            verdict = validation or validate_dataset(path)
            statistics = counted.result()
            shown = [task.result() for task in drawn]
            coverage = covered.result() if covered else ""
            positions = around.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    sections = [
        _head(dataset, verdict),
        "".join(best for best, _ in shown),
        _overview(dataset, statistics),
        *(section for _, section in shown),
        coverage,
        _statistics(statistics),
        positions,
        validation_section(verdict),
        _episode_list(dataset) if len(episodes) > 1 else "",
        f"<footer>Written by Car-STAGE {escape(__version__)}. "
        "Pictures are scaled down; the dataset holds the originals.</footer>",
    ]
    target = out if out is not None else report_file(dataset.path)
    document = html.page(f"{dataset.name}: Car-STAGE dataset", "\n".join(sections))
    write_whole(target, document.encode())
    return target


def _drawn(dataset: Dataset, number: int, *, films: bool) -> tuple[str, str]:
    """The best of the dataset, drawn of its first episode alone, and the section of an episode."""
    pictures = EpisodePictures(dataset.episodes[number], dataset.description)
    best = showcase(pictures) if number == 0 else ""
    return best, episode_section(pictures, films=films)


def report_file(dataset: DatasetPath) -> Path:
    """Where the report goes when nobody says: into the dataset, or for a remote one to here."""
    if isinstance(dataset, RemotePath):
        return Path(f"{dataset.name}-report.html")
    return dataset / "report.html"


def _head(dataset: Dataset, verdict: ValidationReport) -> str:
    return (
        f'<div class="head"><h1>{escape(dataset.name)}</h1>{badge(verdict)}</div>'
        '<p class="soft">A labelled multi-sensor driving dataset, recorded from CARLA by '
        "Car-STAGE.</p>"
    )


def _overview(dataset: Dataset, statistics: LabelStatistics) -> str:
    episodes = dataset.episodes
    size = sum(entry.bytes for episode in episodes for entry in episode.marker.files)
    seconds = sum(episode.frames / frames_per_second(episode) for episode in episodes)
    sensors = {sensor.id for episode in episodes for sensor in episode.sensors}
    return html.tiles(
        [
            html.counted(len(episodes), "episode"),
            html.counted(sum(episode.frames for episode in episodes), "frame"),
            ("simulated time", f"{seconds:.1f} s"),
            html.counted(len(sensors), "sensor"),
            ("objects tracked", f"{statistics.tracks:,}"),
            ("3D boxes", f"{statistics.records:,}"),
            ("visible 2D boxes", f"{statistics.visible:,}"),
            ("size on disk", html.size(size)),
        ]
    )


def _statistics(statistics: LabelStatistics) -> str:
    classes = [
        (name, count, html.css_colour(class_colour(name)))
        for name, count in statistics.by_class.most_common()
    ]

    def binned(title: str, names: list[str], counts: list[int]) -> str:
        return html.bars(title, [(n, c, None) for n, c in zip(names, counts, strict=True)])

    levels = list(OCCLUSION_NAMES)
    by_lidar = binned(
        "Labels by LiDAR points in the box", bin_names(LIDAR_EDGES, ""), statistics.lidar_points
    )
    return (
        "<h2>Labels</h2>"
        '<p class="soft">Objects are counted once per episode; the other charts count labels: '
        "one per frame and object, or per frame, camera and object. The ego is left out.</p>"
        '<div class="grid">'
        + html.bars("Objects by class", classes)
        + binned(
            "Visible objects by distance from the camera",
            bin_names(DISTANCE_EDGES_M, " m"),
            statistics.distances,
        )
        + binned("Occlusion of visible objects, STAGE-VO level", levels, statistics.occluded)
        + binned("Occlusion of visible objects, by pixels", levels, statistics.occluded_px)
        + (by_lidar if any(statistics.lidar_points) else "")
        + "</div>"
    )


def _episode_list(dataset: Dataset) -> str:
    rows = [
        (
            episode.id,
            episode.spec.map,
            weather_name(episode),
            episode.variant or "",
            episode.frames,
            f"{frames_per_second(episode):g} Hz",
            episode.spec.ego.blueprint,
        )
        for episode in dataset.episodes
    ]
    return "<h2>All episodes</h2>" + html.table(
        ("Episode", "Map", "Weather", "Variant", "Frames", "Rate", "Ego"), rows
    )
