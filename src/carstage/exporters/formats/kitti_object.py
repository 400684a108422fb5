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
from carstage.exporters.formats.kitti_files import calibration_matrices, label_row, numbers
from carstage.exporters.formats.pictures import copy_as_png
from carstage.exporters.labels import camera_labels, require_labels
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import main_lidar, one_camera
from carstage.exporters.splits import SPLITS, split_episodes

_FOLDERS = ("image_2", "velodyne", "calib", "label_2")


@dataclass(frozen=True, slots=True)
class ObjectWriter:
    """Writes the four files of a frame; returns its number."""

    options: ExportOptions
    camera: str
    lidar: str | None
    first_number: int

    def __call__(self, frame: Frame, folder: Path) -> tuple[str, int, float] | None:
        """Write the frame: its name, index and time; ``None`` without a picture."""
        if not frame.has(self.camera):
            return None
        name, training = f"{self.first_number + frame.k:06d}", folder / "training"
        copy_as_png(frame, self.camera, training / "image_2" / f"{name}.png")
        camera = frame.episode.sensor(self.camera).calibration
        rows = (
            label_row(label, camera, self.options)
            for label in camera_labels(frame, self.camera, self.options)
        )
        text = "".join(f"{row}\n" for row in rows if row is not None)
        (training / "label_2" / f"{name}.txt").write_text(text, "ascii")
        matrices = calibration_matrices(frame, self.camera, self.lidar)
        lines = [f"{key}: {numbers(matrix)}\n" for key, matrix in matrices.items()]
        (training / "calib" / f"{name}.txt").write_text("".join(lines), "ascii")
        if self.lidar is not None and frame.has(self.lidar):
            points = flu_points(frame.read(self.lidar))
            (training / "velodyne" / f"{name}.bin").write_bytes(points.tobytes())
        return name, frame.k, frame.timestamp_s


@register
class KittiObject(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "kitti-object"
    summary: ClassVar = "KITTI 3D object detection: image_2, velodyne, calib, label_2."
    uses: ClassVar = frozenset(
        {
            "cameras", "lidar", "boxes", "occlusion", "min_lidar_points", "max_distance_m",
            "include_invisible", "validation_share",
        }
    )  # fmt: skip

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs and make KITTI's folders."""
        for episode in episodes:
            require_labels(episode, self.options, "2d", "3d")
            one_camera(episode, self.options)
            main_lidar(episode, self.options)
        for name in _FOLDERS:
            (folder / "training" / name).mkdir(parents=True)
        (folder / "ImageSets").mkdir()
        self._splits = split_episodes(episodes, self.options.validation_share)
        self._lists: dict[str, IO[str]] = {
            split: self.files.enter_context(
                (folder / "ImageSets" / f"{split}.txt").open("w", encoding="ascii")
            )
            for split in (*SPLITS, "trainval")
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
        return ObjectWriter(self.options, self._camera, lidar.id if lidar else None, self._number)

    def add(self, part: tuple[str, int, float]) -> None:
        """List the frame."""
        name, k, time_s = part
        for split in (self._splits[self._episode.id], "trainval"):
            self._lists[split].write(f"{name}\n")
        self._index.write(f"{name},{self._episode.id},{k},{time_s:.6f},{self._camera}\n")

    def end_episode(self) -> None:
        """Go on counting after its frames."""
        self._number += self._episode.frames

    def finish(self) -> None:
        """Close the lists."""
        self.close()
