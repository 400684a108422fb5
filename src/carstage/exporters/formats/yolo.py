"""YOLO: a text file per picture with class and box, for Darknet and for Ultralytics."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, ClassVar

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.coco_categories import COCO80, COCO_CATEGORIES, with_categories
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.pictures import copy_picture
from carstage.exporters.labels import camera_labels, require_labels
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras
from carstage.exporters.splits import Split
from carstage.geometry import yolo_rectangle


def class_numbers(options: ExportOptions) -> dict[str, int]:
    """The number of each of Car-STAGE's classes that are exported; YOLO counts from 0."""
    if options.categories == "coco80":
        places = {number: place for place, number in enumerate(COCO_CATEGORIES)}
        return {name: places[n] for name, n in COCO80.numbers_of_classes(0).items()}
    if options.class_map is not None:
        return options.class_map.numbers_of_classes(0)
    return {name: number for number, name in enumerate(options.chosen_classes)}


def class_names(options: ExportOptions) -> list[str]:
    """The names of all numbers from 0 on.

    Raises:
        BadInputError: the class map's numbers have a gap.
    """
    if options.categories == "coco80":
        return [name for name, _ in COCO_CATEGORIES.values()]
    if options.class_map is None:
        return list(options.chosen_classes)
    names = {number: name for name, number in options.class_map.numbers(0).items()}
    for number in range(len(names)):
        if number not in names:
            raise BadInputError(
                f"class-map: YOLO counts classes from 0 without a gap, and none has the id "
                f"{number}.",
                f"Give the ids 0 to {len(names) - 1}, or no ids.",
            )
    return [names[number] for number in range(len(names))]


@dataclass(frozen=True, slots=True)
class YoloWriter:
    """Writes pictures and boxes of a frame; returns the pictures' paths in the export."""

    options: ExportOptions
    cameras: tuple[str, ...]
    split: Split

    def __call__(self, frame: Frame, folder: Path) -> tuple[str, ...] | None:
        """Write the frame; ``None`` without any labelled picture."""
        written = []
        for camera_id in self.cameras:
            if not frame.has_labelled(camera_id):
                continue
            name = f"{frame.episode.id}_{camera_id}_{frame.k:06d}"
            picture = copy_picture(frame, camera_id, folder / "images" / self.split / name)
            camera = frame.episode.sensor(camera_id).calibration
            numbers_of = class_numbers(self.options)
            lines = []
            for label in camera_labels(frame, camera_id, self.options):
                box = yolo_rectangle(label.box, camera.width, camera.height)
                numbers = " ".join(f"{value:.6f}" for value in box)
                lines.append(f"{numbers_of[label.name]} {numbers}\n")
            # Beside the picture, too: AlexeyAB's Darknet knows no folder `labels` of such a place.
            for path in (folder / "labels" / self.split / name, picture):
                path.with_name(f"{name}.txt").write_text("".join(lines), "ascii")
            written.append(picture.relative_to(folder).as_posix())
        return tuple(written) or None


@register
class Yolo(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "yolo"
    summary: ClassVar = "YOLO 2D boxes: images, labels, Darknet's obj.data, Ultralytics' data.yaml."
    uses: ClassVar = frozenset(
        {
            "cameras", "boxes", "classes", "min_lidar_points", "max_distance_m",
            "include_invisible", "categories", "class_map",
            "val_share", "test_share",
        }
    )  # fmt: skip

    def __init__(self, options: ExportOptions) -> None:
        mapped = with_categories(options)
        super().__init__(replace(mapped, boxes=mapped.boxes or "modal"))
        self._names = class_names(mapped)

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs and make the folders."""
        for episode in episodes:
            require_labels(episode, self.options, "2d")
            colour_cameras(episode, self.options)
        self._splits = self.used_splits(episodes)
        for kind in ("images", "labels"):
            for split in self._splits:
                (folder / kind / split).mkdir(parents=True)
        self._folder = folder
        self._lists: dict[Split, IO[str]] = {
            split: self.files.enter_context((folder / f"{split}.txt").open("w", encoding="utf-8"))
            for split in self._splits
        }

    def begin_episode(self, episode: Episode) -> YoloWriter:
        """All frames of an episode go to one split."""
        cameras = tuple(camera.id for camera in colour_cameras(episode, self.options))
        self._split = self.split_of(episode)
        return YoloWriter(self.options, cameras, self._split)

    def add(self, part: tuple[str, ...]) -> None:
        """List the pictures."""
        self._lists[self._split].writelines(f"./{name}\n" for name in part)

    def end_episode(self) -> None:
        """Nothing is kept per episode."""

    def finish(self) -> None:
        """Write the names of the classes."""
        self.close()
        lines = "".join(f"{name}\n" for name in self._names)
        (self._folder / "obj.names").write_text(lines, "utf-8")
        lists = {"train": "train", "val": "valid"}
        (self._folder / "obj.data").write_text(
            f"classes = {len(self._names)}\n"
            + "".join(f"{lists[s]} = {s}.txt\n" for s in self._splits if s in lists)
            + "names = obj.names\nbackup = backup\n"
        )
        # A JSON text is YAML too, whatever the name is.
        names = "".join(
            f"  {number}: {json.dumps(name, ensure_ascii=False)}\n"
            for number, name in enumerate(self._names)
        )
        # Ultralytics refuses a file without one of these two.
        folders = {
            split: f"# No episode is for {purpose}.\n{split}: images/{self._splits[0]}\n"
            for split, purpose in (("train", "training"), ("val", "validation"))
        }
        folders |= {split: f"{split}: images/{split}\n" for split in self._splits}
        text = "".join(folders.values()) + f"names:\n{names}"
        (self._folder / "data.yaml").write_text(text, "utf-8")
