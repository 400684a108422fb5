"""KITTI's tracking benchmark: an episode is a sequence, with labels in one file."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
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
from carstage.exporters.views import View, chosen_views

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
    """Writes pictures and points of a frame; returns the rows of each sequence.

    Attributes:
        options: the export's.
        views: a camera for each sequence.
        sequences: their names.
        part: the folder.
    """

    options: ExportOptions
    views: tuple[View, ...]
    sequences: tuple[str, ...]
    part: str

    def __call__(self, frame: Frame, folder: Path) -> tuple[SequencePart | None, ...] | None:
        """Write the frame; ``None`` for cameras without a labelled picture, or without any."""
        parts = tuple(
            self._write(view, sequence, frame, folder)
            if frame.has_labelled(view.camera.id)
            else None
            for view, sequence in zip(self.views, self.sequences, strict=True)
        )
        return parts if any(part is not None for part in parts) else None

    def _write(self, view: View, sequence: str, frame: Frame, folder: Path) -> SequencePart:
        name, part = f"{frame.k:06d}", folder / self.part
        copy_as_png(frame, view.camera.id, part / "image_02" / sequence / f"{name}.png")
        points = view.points(frame)
        if points is not None:
            path = part / "velodyne" / sequence / f"{name}.bin"
            path.write_bytes(flu_points(points).tobytes())
        labels = []
        for label in camera_labels(view.frame(frame), view.camera.id, self.options):
            row = label_row(label, view.camera, self.options)
            if row is not None:
                labels.append((label.seen["track_id"], _with_truncation_level(row)))
        lines = [
            f"{_TRACKING_NAMES.get(key, key + ':')} {numbers(matrix)}\n"
            for key, matrix in calibration_matrices(frame, view).items()
        ]
        inertial = inertial_row(frame.ego) if view.is_on_ego and frame.ego is not None else None
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
            for view in chosen_views(episode, self.options):
                if view.car is None:
                    raise BadInputError(
                        f"The camera {view.camera.id} moves against the ego, and a sequence has "
                        "one calibration.",
                        "Choose cameras on vehicles, or the format kitti-object.",
                    )
        self._folder = folder
        self._splits = self.used_splits(episodes)
        for part in {part_of(split): None for split in self._splits}:
            for name in ("image_02", "velodyne", "calib", "label_02", "oxts"):
                (folder / part / name).mkdir(parents=True)
        self._sequences: list[_Sequence] = []

    def begin_episode(self, episode: Episode) -> SequenceWriter:
        """Open the files of a sequence for each camera."""
        views = chosen_views(episode, self.options)
        part = self._folder / part_of(self.split_of(episode))
        self._open = tuple(
            _Sequence(f"{len(self._sequences) + n:04d}", episode, view, part, self.files)
            for n, view in enumerate(views)
        )
        self._sequences += self._open
        names = tuple(sequence.name for sequence in self._open)
        return SequenceWriter(self.options, views, names, part.name)

    def add(self, part: tuple[SequencePart | None, ...]) -> None:
        """Append the rows of each sequence."""
        for sequence, of_sequence in zip(self._open, part, strict=True):
            if of_sequence is not None:
                sequence.add(of_sequence)

    def end_episode(self) -> None:
        """Close the files of the sequences."""
        self.close()
        for sequence in self._open:
            sequence.end()

    def finish(self) -> None:
        """Write the devkit's lists of sequences, ``evaluate_tracking.seqmap.*``."""
        for split in self._splits:
            chosen = [s for s in self._sequences if self.split_of(s.episode) == split]
            lines = [f"{s.name} empty 000000 {s.episode.frames:06d}\n" for s in chosen]
            path = self._folder / f"evaluate_tracking.seqmap.{split}"
            path.write_text("".join(lines), "ascii")
        lines = [f"{s.name},{s.episode.id},{s.camera}\n" for s in self._sequences]
        text = "sequence,episode_id,camera\n" + "".join(lines)
        (self._folder / "sequences.csv").write_text(text)


class _Sequence:
    """The files of one sequence.

    Args:
        name: its number.
        episode: whose camera it is.
        view: the camera.
        part: ``training`` or ``testing``.
        files: closes what is opened.
    """

    def __init__(
        self, name: str, episode: Episode, view: View, part: Path, files: ExitStack
    ) -> None:
        self.name, self.episode, self.camera = name, episode, view.camera.id
        self._part = part
        for folder in ("image_02", "velodyne"):
            (part / folder / name).mkdir()
        self._labels = files.enter_context(
            (part / "label_02" / f"{name}.txt").open("w", encoding="ascii")
        )
        self._inertial = files.enter_context(
            (part / "oxts" / f"{name}.txt").open("w", encoding="ascii")
        )
        self._calibration: str | None = None
        self._tracks: dict[int, int] = {}
        self._next_k = 0

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

    def end(self) -> None:
        """Write the calibration."""
        path = self._part / "calib" / f"{self.name}.txt"
        path.write_text(self._calibration or "", "ascii")
