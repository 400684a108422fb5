"""Recompute from the files whether a dataset is what it says it is."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.checks.edges import EdgeFigures, check_edges, compare_edges
from carstage.dataset.checks.files import DOCUMENTS, TABLES, VerifiedFiles, check_file_list
from carstage.dataset.checks.findings import Findings, Problem
from carstage.dataset.checks.labels import (
    LabelledBox,
    LabelTables,
    camera_rows,
    check_labels,
    labelled_boxes,
)
from carstage.dataset.checks.ledger import (
    check_ledger,
    check_row_sensors,
    recorded_frames,
    saved_times_s,
)
from carstage.dataset.checks.ranging import (
    RangingFigures,
    check_point_counts,
    check_share,
    compare_with_depth,
)
from carstage.dataset.checks.server import check_self_test
from carstage.dataset.checks.silhouettes import (
    SilhouetteFigures,
    check_silhouettes,
    visible_objects,
)
from carstage.dataset.codecs.semantic_points import points_xyz
from carstage.dataset.reading import Dataset, Episode, Sensor
from carstage.dataset.tables import ROW_SENSORS
from carstage.errors import CarStageError

REPORT_FORMAT = 1
_LIDARS = ("lidar", "semantic_lidar")


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """The verdict over a dataset.

    Attributes:
        problems: everything that was found, in the order of the episodes.
        figures: what was measured: numbers of episodes, frames, files and bytes; ``hull``: pixels
            of objects and how many lie outside their box; ``lidar_depth``: by pair of LiDAR and
            depth camera, points compared and the share that agrees; ``lidar_points_in_boxes``;
            ``rgb_edges``: by camera, how much steeper the image is where labels change.
    """

    problems: tuple[Problem, ...]
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
                "figures": self.figures,
            }
        )


@dataclass(slots=True)
class _Figures:
    frames: int = 0
    files: int = 0
    bytes: int = 0
    points_in_boxes: int = 0
    hull: SilhouetteFigures = field(default_factory=SilhouetteFigures)
    pairs: dict[tuple[str, str], RangingFigures] = field(
        default_factory=lambda: defaultdict(RangingFigures)
    )
    edges: dict[str, EdgeFigures] = field(default_factory=lambda: defaultdict(EdgeFigures))

    def to_dict(self, episodes: int) -> dict[str, Any]:
        return {
            "episodes": episodes,
            "frames": self.frames,
            "files": self.files,
            "bytes": self.bytes,
            "hull": self.hull.to_dict(),
            "lidar_depth": {
                f"{lidar} / {camera}": pair.to_dict()
                for (lidar, camera), pair in sorted(self.pairs.items())
            },
            "lidar_points_in_boxes": self.points_in_boxes,
            "rgb_edges": {
                camera: None if edges.ratio is None else round(edges.ratio, 3)
                for camera, edges in sorted(self.edges.items())
            },
        }


def validate_dataset(
    path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> ValidationReport:
    """Check every committed episode; what is not committed is not looked at.

    Checked are: every promised file exists, has the size and hash of the marker, and decodes to
    the right shape; the ledger is complete and its states are good; timestamps; label columns,
    keys and ranges; pixels of objects inside their boxes; LiDAR against depth; points in boxes.
    How exactly stands in ``docs/formats/dataset.md`` and in the modules of ``checks``.

    Args:
        path: folder of the dataset.
        progress: called with (frames checked, frames in all).

    Raises:
        DatasetError: the folder is no dataset, of another format version, or a marker is damaged.
    """
    dataset = Dataset(path)
    total = sum(episode.frames for episode in dataset.episodes)
    figures = _Figures()
    problems: list[Problem] = []
    if not dataset.episodes:
        findings = Findings(None)
        findings.add("empty", "the dataset has no committed episode")
        problems += findings.problems()
    for episode in dataset.episodes:
        findings = Findings(episode.id)
        checks = _EpisodeChecks(episode, findings, figures)
        before = figures.frames
        try:
            checks.run(lambda: progress(figures.frames, total) if progress else None)
        except CarStageError as error:
            findings.add("unreadable", str(error))
            figures.frames = before + episode.frames
        problems += findings.problems()
    return ValidationReport(tuple(problems), figures.to_dict(len(dataset.episodes)))


class _EpisodeChecks:
    """All checks of one episode, in one pass over its frames."""

    def __init__(self, episode: Episode, findings: Findings, figures: _Figures) -> None:
        self._episode = episode
        self._findings = findings
        self._figures = figures
        self._files = VerifiedFiles(episode, findings)
        self._pairs: dict[tuple[str, str], RangingFigures] = defaultdict(RangingFigures)
        self._edges: dict[str, EdgeFigures] = defaultdict(EdgeFigures)

    def run(self, advance: Callable[[], None]) -> None:
        episode, findings = self._episode, self._findings
        for name in (*DOCUMENTS, *TABLES):
            self._files.read(episode.folder / name)
        ledger = episode.ledger()
        recorded = recorded_frames(episode, ledger)
        check_file_list(episode, recorded, findings)
        check_ledger(episode, ledger, findings)
        for sensor in episode.sensors:
            if sensor.kind in ROW_SENSORS:
                self._files.read(sensor.paths(0)[0], sensor=sensor.id)
        check_row_sensors(episode, ledger, recorded, findings)
        check_self_test(episode, findings)
        tables = LabelTables.load(episode)
        check_labels(episode, tables, saved_times_s(ledger), findings)
        boxes = labelled_boxes(tables, findings)
        rows = camera_rows(tables.camera_objects)
        available = {sensor: set(frames) for sensor, frames in recorded.items()}
        for k in range(episode.frames):
            data = {
                sensor.id: array
                for sensor in episode.sensors
                if sensor.kind not in ROW_SENSORS and k in available[sensor.id]
                if (array := self._decoded(sensor, k)) is not None
            }
            self._check_silhouettes(k, rows, boxes.get(k, []), data)
            self._check_ranging(k, boxes.get(k, []), data)
            self._compare_edges(k, rows, data)
            self._figures.frames += 1
            advance()
        for (lidar, camera), pair in self._pairs.items():
            check_share(pair, lidar, camera, findings)
        for camera, edges in self._edges.items():
            check_edges(camera, edges, findings)
        self._figures.files += self._files.files
        self._figures.bytes += self._files.bytes

    def _decoded(self, sensor: Sensor, k: int) -> NDArray[Any] | None:
        contents = [self._files.read(path, frame=k, sensor=sensor.id) for path in sensor.paths(k)]
        whole = [content for content in contents if content is not None]
        if len(whole) != len(contents):
            return None
        where: dict[str, Any] = {"frame": k, "sensor": sensor.id}
        try:
            array = sensor.decode(whole)
        except ValueError as error:
            self._findings.add("decode", f"the frame does not decode: {error}", **where)
            return None
        camera = sensor.calibration
        if camera.is_camera and array.shape[:2] != (camera.height, camera.width):
            self._findings.add(
                "image_size",
                f"the image has {array.shape[1]}x{array.shape[0]} pixels, "
                f"not {camera.width}x{camera.height}",
                **where,
            )
            return None
        return array

    def _check_silhouettes(
        self,
        k: int,
        rows: Mapping[tuple[int, str], list[dict[str, Any]]],
        boxes: list[LabelledBox],
        data: Mapping[str, NDArray[Any]],
    ) -> None:
        for sensor in self._episode.sensors:
            if sensor.calibration.labelled:
                camera = sensor.calibration_at(k)
                instance = data.get(camera.instance) if camera.instance else None
                check_silhouettes(
                    camera,
                    k,
                    rows.get((k, camera.id), []),
                    boxes,
                    instance,
                    self._figures.hull,
                    self._findings,
                )

    def _check_ranging(
        self, k: int, boxes: list[LabelledBox], data: Mapping[str, NDArray[Any]]
    ) -> None:
        sensors = [sensor for sensor in self._episode.sensors if sensor.id in data]
        for lidar in (sensor for sensor in sensors if sensor.kind in _LIDARS):
            points = points_xyz(data[lidar.id])
            if lidar.kind == "lidar":
                self._figures.points_in_boxes += check_point_counts(
                    points, lidar.calibration_at(k), k, boxes, self._findings
                )
            for camera in (sensor for sensor in sensors if sensor.kind == "depth"):
                found = compare_with_depth(
                    points, lidar.calibration_at(k), data[camera.id], camera.calibration_at(k)
                )
                check_share(found, lidar.id, camera.id, self._findings, frame=k)
                for totals in (
                    self._pairs[lidar.id, camera.id],
                    self._figures.pairs[lidar.id, camera.id],
                ):
                    totals.in_view += found.in_view
                    totals.comparable += found.comparable
                    totals.agreeing += found.agreeing

    def _compare_edges(
        self,
        k: int,
        rows: Mapping[tuple[int, str], list[dict[str, Any]]],
        data: Mapping[str, NDArray[Any]],
    ) -> None:
        for sensor in self._episode.sensors:
            camera = sensor.calibration
            if sensor.kind != "rgb" or not camera.labelled or sensor.id not in data:
                continue
            if camera.instance is not None and camera.instance in data:
                instance = data[camera.instance].astype(np.uint32)
                labels = instance[..., 0] << 8 | instance[..., 1]
            else:
                labels = visible_objects(camera, rows.get((k, camera.id), []))
            found = compare_edges(data[sensor.id], labels)
            self._edges[sensor.id].add(found)
            self._figures.edges[sensor.id].add(found)
