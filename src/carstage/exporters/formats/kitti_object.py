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
from carstage.exporters.rigs import main_lidar, one_camera
from carstage.exporters.splits import Split

_FOLDERS = ("image_2", "velodyne", "calib", "label_2")


def part_of(split: Split) -> str:
    """The folder of KITTI that devkits look for a split in."""
    return "testing" if split == "test" else "training"


@dataclass(frozen=True, slots=True)
class ObjectWriter:
    """Writes the four files of a frame; returns its number."""

    options: ExportOptions
    camera: str
    lidar: str | None
    first_number: int
    part: str

    def __call__(self, frame: Frame, folder: Path) -> tuple[str, int, float] | None:
        """Write the frame: its name, index and time; ``None`` without a picture."""
        if not frame.has(self.camera):
            return None
        name, part = f"{self.first_number + frame.k:06d}", folder / self.part
        copy_as_png(frame, self.camera, part / "image_2" / f"{name}.png")
        camera = frame.episode.sensor(self.camera).calibration
        rows = (
            label_row(label, camera, self.options)
            for label in camera_labels(frame, self.camera, self.options)
        )
        text = "".join(f"{row}\n" for row in rows if row is not None)
        (part / "label_2" / f"{name}.txt").write_text(text, "ascii")
        matrices = calibration_matrices(frame, self.camera, self.lidar)
        lines = [f"{key}: {numbers(matrix)}\n" for key, matrix in matrices.items()]
        (part / "calib" / f"{name}.txt").write_text("".join(lines), "ascii")
        if self.lidar is not None and frame.has(self.lidar):
            points = flu_points(frame.read(self.lidar))
            (part / "velodyne" / f"{name}.bin").write_bytes(points.tobytes())
        return name, frame.k, frame.timestamp_s


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
            one_camera(episode, self.options)
            main_lidar(episode, self.options)
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
        """Number its frames after those of the episodes before."""
        lidar = main_lidar(episode, self.options)
        self._episode = episode
        self._camera = one_camera(episode, self.options).id
        return ObjectWriter(
            self.options,
            self._camera,
            lidar.id if lidar else None,
            self._number,
            part_of(self.split_of(episode)),
        )

    def add(self, part: tuple[str, int, float]) -> None:
        """List the frame."""
        name, k, time_s = part
        split = self.split_of(self._episode)
        for listed in (split,) if split == "test" else (split, "trainval"):
            self._lists[listed].write(f"{name}\n")
        self._index.write(f"{name},{self._episode.id},{k},{time_s:.6f},{self._camera}\n")

    def end_episode(self) -> None:
        """Go on counting after its frames."""
        self._number += self._episode.frames

    def finish(self) -> None:
        """Close the lists."""
        self.close()
