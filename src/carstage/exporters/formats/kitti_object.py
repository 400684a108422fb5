"""KITTI's object benchmark: a picture, a point cloud, a calibration and labels per frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, ClassVar

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.exporters.axes import flu_points
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.kitti_files import (
    calibration_matrices,
    kitti_defaults,
    label_row,
    numbers,
)
from carstage.exporters.formats.pictures import copy_as_png
from carstage.exporters.labels import camera_labels, require_labels
from carstage.exporters.options import ExportOptions
from carstage.exporters.splits import Split
from carstage.exporters.views import View, chosen_views

_FOLDERS = ("image_2", "velodyne", "calib", "label_2")


def part_of(split: Split) -> str:
    """The folder of KITTI that devkits look for a split in."""
    return "testing" if split == "test" else "training"


@dataclass(frozen=True, slots=True)
class PicturePart:
    """A picture that was written: its name, frame, time and camera."""

    name: str
    k: int
    time_s: float
    camera: str


@dataclass(frozen=True, slots=True)
class ObjectWriter:
    """Writes the four files of each picture of a frame.

    Attributes:
        options: the export's.
        views: the cameras; the pictures of a frame follow each other.
        first_number: of the episode's first picture.
        part: the folder.
    """

    options: ExportOptions
    views: tuple[View, ...]
    first_number: int
    part: str

    def __call__(self, frame: Frame, folder: Path) -> tuple[PicturePart, ...] | None:
        """Write the frame, cameras without a labelled picture left out; ``None`` without any."""
        parts = tuple(
            self._write(view, number, frame, folder)
            for number, view in enumerate(self.views)
            if frame.has_labelled(view.camera.id)
        )
        return parts or None

    def _write(self, view: View, number: int, frame: Frame, folder: Path) -> PicturePart:
        number += self.first_number + frame.k * len(self.views)
        name, part = f"{number:06d}", folder / self.part
        copy_as_png(frame, view.camera.id, part / "image_2" / f"{name}.png")
        rows = (
            label_row(label, view.camera, self.options)
            for label in camera_labels(view.frame(frame), view.camera.id, self.options)
        )
        text = "".join(f"{row}\n" for row in rows if row is not None)
        (part / "label_2" / f"{name}.txt").write_text(text, "ascii")
        matrices = calibration_matrices(frame, view)
        lines = [f"{key}: {numbers(matrix)}\n" for key, matrix in matrices.items()]
        (part / "calib" / f"{name}.txt").write_text("".join(lines), "ascii")
        points = view.points(frame)
        if points is not None:
            (part / "velodyne" / f"{name}.bin").write_bytes(flu_points(points).tobytes())
        return PicturePart(name, frame.k, frame.timestamp_s, view.camera.id)


@register
class KittiObject(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "kitti-object"
    summary: ClassVar = "KITTI 3D object detection: image_2, velodyne, calib, label_2."
    uses: ClassVar = frozenset(
        {
            "cameras", "lidar", "boxes", "occlusion", "min_lidar_points", "max_distance_m",
            "include_invisible", "class_map", "val_share", "test_share",
        }
    )  # fmt: skip

    def __init__(self, options: ExportOptions) -> None:
        super().__init__(kitti_defaults(options))

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs and make KITTI's folders."""
        for episode in episodes:
            require_labels(episode, self.options, "2d", "3d")
            chosen_views(episode, self.options)
        splits = self.used_splits(episodes)
        for part in {part_of(split): None for split in splits}:
            for name in _FOLDERS:
                (folder / part / name).mkdir(parents=True)
        (folder / "ImageSets").mkdir()
        self._lists: dict[str, IO[str]] = {
            split: self.files.enter_context(
                (folder / "ImageSets" / f"{split}.txt").open("w", encoding="ascii")
            )
            for split in (*splits, "trainval")
        }
        index = (folder / "frames.csv").open("w", encoding="utf-8")
        self._index = self.files.enter_context(index)
        self._index.write("name,episode_id,k,timestamp_s,camera\n")
        self._number = 0

    def begin_episode(self, episode: Episode) -> ObjectWriter:
        """Number its pictures after those of the episodes before."""
        self._episode = episode
        self._views = chosen_views(episode, self.options)
        part = part_of(self.split_of(episode))
        return ObjectWriter(self.options, self._views, self._number, part)

    def add(self, part: tuple[PicturePart, ...]) -> None:
        """List the pictures of a frame."""
        split = self.split_of(self._episode)
        for picture in part:
            for listed in (split,) if split == "test" else (split, "trainval"):
                self._lists[listed].write(f"{picture.name}\n")
            self._index.write(
                f"{picture.name},{self._episode.id},{picture.k},{picture.time_s:.6f},"
                f"{picture.camera}\n"
            )

    def end_episode(self) -> None:
        """Go on counting after its pictures."""
        self._number += self._episode.frames * len(self._views)

    def finish(self) -> None:
        """Close the lists."""
        self.close()
