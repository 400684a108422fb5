"""KITTI's tracking benchmark: an episode is a sequence, with labels in one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.axes import flu_points
from carstage.exporters.classes import DONT_CARE
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.kitti_files import (
    calibration_matrices,
    inertial_row,
    kitti_defaults,
    label_row,
    numbers,
)
from carstage.exporters.formats.kitti_object import KittiObject, part_of
from carstage.exporters.formats.pictures import copy_as_png
from carstage.exporters.labels import camera_labels, require_labels
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import main_lidar, one_camera

# The tracking devkit names these without a colon.
_TRACKING_NAMES = {
    "R0_rect": "R_rect", "Tr_velo_to_cam": "Tr_velo_cam", "Tr_imu_to_velo": "Tr_imu_velo",
}  # fmt: skip
_NO_INERTIAL = " ".join(["nan"] * 25 + ["0"] * 5)
_SLIGHTLY, _MOSTLY = 0.005, 0.5
"""Truncations from which on the levels are 1 and 2; the devkit gives no bounds."""


@dataclass(frozen=True, slots=True)
class SequencePart:
    """What a frame adds to the files of its sequence; label rows by CARLA's track id."""

    k: int
    labels: tuple[tuple[int, str], ...]
    inertial: str | None
    calibration: str


@dataclass(frozen=True, slots=True)
class SequenceWriter:
    """Writes picture and points of a frame; returns its rows."""

    options: ExportOptions
    camera: str
    lidar: str | None
    sequence: str
    part: str

    def __call__(self, frame: Frame, folder: Path) -> SequencePart | None:
        """Write the frame; ``None`` without a picture."""
        if not frame.has(self.camera):
            return None
        name, part = f"{frame.k:06d}", folder / self.part
        copy_as_png(frame, self.camera, part / "image_02" / self.sequence / f"{name}.png")
        if self.lidar is not None and frame.has(self.lidar):
            points = flu_points(frame.read(self.lidar))
            path = part / "velodyne" / self.sequence / f"{name}.bin"
            path.write_bytes(points.tobytes())
        camera = frame.episode.sensor(self.camera).calibration
        labels = []
        for label in camera_labels(frame, self.camera, self.options):
            row = label_row(label, camera, self.options)
            if row is not None:
                labels.append((label.seen["track_id"], _with_truncation_level(row)))
        matrices = calibration_matrices(frame, self.camera, self.lidar)
        lines = [
            f"{_TRACKING_NAMES.get(key, key + ':')} {numbers(matrix)}\n"
            for key, matrix in matrices.items()
        ]
        inertial = inertial_row(frame.ego) if frame.ego is not None else None
        return SequencePart(frame.k, tuple(labels), inertial, "".join(lines))


def _with_truncation_level(row: str) -> str:
    """The row with KITTI tracking's 0, 1, 2 instead of the share that is truncated."""
    name, truncated, rest = row.split(" ", 2)
    if name == DONT_CARE:
        return row
    level = sum(float(truncated) >= bound for bound in (_SLIGHTLY, _MOSTLY))
    return f"{name} {level} {rest}"


@register
class KittiTracking(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "kitti-tracking"
    summary: ClassVar = "KITTI tracking: sequences with image_02, velodyne, calib, label_02, oxts."
    uses: ClassVar = KittiObject.uses

    def __init__(self, options: ExportOptions) -> None:
        super().__init__(kitti_defaults(options))

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs and make KITTI's folders."""
        for episode in episodes:
            require_labels(episode, self.options, "2d", "3d")
            main_lidar(episode, self.options)
            camera = one_camera(episode, self.options)
            if not camera.on_ego:
                raise BadInputError(
                    f"The camera {camera.id} moves against the ego, and a sequence has one "
                    "calibration.",
                    "Choose a camera on the ego, or the format kitti-object.",
                )
        self._folder = folder
        self._splits = self.used_splits(episodes)
        for part in {part_of(split): None for split in self._splits}:
            for name in ("image_02", "velodyne", "calib", "label_02", "oxts"):
                (folder / part / name).mkdir(parents=True)
        self._sequences: list[tuple[str, Episode]] = []

    def begin_episode(self, episode: Episode) -> SequenceWriter:
        """Open the files of a new sequence."""
        lidar = main_lidar(episode, self.options)
        sequence = f"{len(self._sequences):04d}"
        self._sequences.append((sequence, episode))
        self._part = self._folder / part_of(self.split_of(episode))
        for name in ("image_02", "velodyne"):
            (self._part / name / sequence).mkdir()
        self._labels = self.files.enter_context(
            (self._part / "label_02" / f"{sequence}.txt").open("w", encoding="ascii")
        )
        self._inertial = self.files.enter_context(
            (self._part / "oxts" / f"{sequence}.txt").open("w", encoding="ascii")
        )
        self._calibration: str | None = None
        self._tracks: dict[int, int] = {}
        self._next_k = 0
        return SequenceWriter(
            self.options,
            one_camera(episode, self.options).id,
            lidar.id if lidar else None,
            sequence,
            self._part.name,
        )

    def add(self, part: SequencePart) -> None:
        """Append the rows, with tracks numbered from 0 as they appear."""
        if self._calibration is None:
            self._calibration = part.calibration
        for track_id, row in part.labels:
            dont_care = row.startswith(DONT_CARE)
            track = -1 if dont_care else self._tracks.setdefault(track_id, len(self._tracks))
            self._labels.write(f"{part.k} {track} {row}\n")
        if part.inertial is not None:
            # The n-th row is frame n's: a frame that was left out has one without numbers.
            self._inertial.write((_NO_INERTIAL + "\n") * (part.k - self._next_k))
            self._inertial.write(part.inertial + "\n")
        self._next_k = part.k + 1

    def end_episode(self) -> None:
        """Close the files of the sequence."""
        self.close()
        sequence = self._sequences[-1][0]
        path = self._part / "calib" / f"{sequence}.txt"
        path.write_text(self._calibration or "", "ascii")

    def finish(self) -> None:
        """Write the devkit's lists of sequences, ``evaluate_tracking.seqmap.*``."""
        for split in self._splits:
            chosen = [(s, e) for s, e in self._sequences if self.split_of(e) == split]
            lines = [f"{sequence} empty 000000 {e.frames:06d}\n" for sequence, e in chosen]
            path = self._folder / f"evaluate_tracking.seqmap.{split}"
            path.write_text("".join(lines), "ascii")
        lines = [f"{sequence},{episode.id}\n" for sequence, episode in self._sequences]
        (self._folder / "sequences.csv").write_text("sequence,episode_id\n" + "".join(lines))
