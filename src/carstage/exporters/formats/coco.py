"""COCO: boxes and masks of objects, and panoptic segments where the rig has an instance camera."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from PIL import Image

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.exporters.classes import CLASSES, RIDER, VEHICLES
from carstage.exporters.coco_categories import COCO_CATEGORIES, with_categories
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.panoptic import panoptic_categories, panoptic_segments
from carstage.exporters.formats.pictures import copy_picture
from carstage.exporters.json_rows import JsonRows
from carstage.exporters.labels import CameraLabel, camera_labels, require_labels
from carstage.exporters.lenses import lens_entry
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras
from carstage.exporters.splits import Split
from carstage.exporters.variants import variant_entry
from carstage.geometry import coco_rectangle

CATEGORIES = {name: number for number, name in enumerate(CLASSES, 1)}
Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class CocoPart:
    """One picture: its row without an id, its annotations, and its panoptic segments."""

    image: Row
    annotations: tuple[Row, ...]
    segments: tuple[Row, ...] | None


@dataclass(frozen=True, slots=True)
class CocoWriter:
    """Writes pictures and panoptic images of a frame; returns their rows."""

    options: ExportOptions
    cameras: tuple[str, ...]
    split: Split

    def __call__(self, frame: Frame, folder: Path) -> tuple[CocoPart, ...] | None:
        """Write the frame; ``None`` without any labelled picture."""
        parts = tuple(
            self._picture(frame, camera_id, folder)
            for camera_id in self.cameras
            if frame.has_labelled(camera_id)
        )
        return parts or None

    def _picture(self, frame: Frame, camera_id: str, folder: Path) -> CocoPart:
        camera = frame.episode.sensor(camera_id).calibration
        name = f"{frame.episode.id}_{camera_id}_{frame.k:06d}"
        picture = copy_picture(frame, camera_id, folder / self.split / name)
        image = {
            "file_name": picture.name, "width": camera.width, "height": camera.height,
            "episode_id": frame.episode.id, "k": frame.k, "timestamp_s": frame.timestamp_s,
            "camera": camera_id, "K": camera.k.tolist(), **lens_entry(camera),
            **variant_entry(frame.episode),
        }  # fmt: skip
        numbers = category_numbers(self.options)
        annotations = tuple(
            _annotation(label, camera, numbers[label.name])
            for label in camera_labels(frame, camera_id, self.options)
        )
        segments = None
        if camera.instance is not None and frame.has(camera.instance):
            ids, segments = panoptic_segments(frame.read(camera.instance))
            pixels = np.stack([ids & 255, ids >> 8 & 255, ids >> 16], axis=-1).astype(np.uint8)
            path = folder / "annotations" / f"panoptic_{self.split}" / f"{name}.png"
            Image.fromarray(pixels).save(path, "PNG", compress_level=1)
        return CocoPart(image, annotations, segments)


def category_numbers(options: ExportOptions) -> Mapping[str, int]:
    """The number of each of Car-STAGE's classes."""
    class_map = options.class_map
    return CATEGORIES if class_map is None else class_map.numbers_of_classes(1)


def categories(options: ExportOptions) -> list[Row]:
    """The rows of ``categories``; of COCO's own all 80, as programs count them by their places."""
    if options.categories == "coco80":
        return [
            {"id": number, "name": name, "supercategory": group}
            for number, (name, group) in COCO_CATEGORIES.items()
        ]
    numbers, class_map = category_numbers(options), options.class_map
    named = {} if class_map is None else {name: t.name for name, t in class_map.targets}
    rows = {
        numbers[name]: {
            "id": numbers[name],
            "name": named.get(name, name),
            "supercategory": _supercategory(name),
        }
        for name in reversed(options.chosen_classes)
    }
    return [rows[number] for number in sorted(rows)]


def _annotation(label: CameraLabel, camera: SensorCalibration, number: int) -> Row:
    seen = label.seen
    x, y, width, height = coco_rectangle(label.box)
    row: dict[str, Any] = {
        "category_id": number,
        "bbox": [x, y, width, height],
        "area": float(width * height),
        "iscrowd": 0,
        "track_id": seen["track_id"],
        "truncated": seen["truncated"],
        "occlusion_ratio": seen["occlusion_ratio"],
    }
    if seen["mask_modal"] is not None:
        size = [camera.height, camera.width]
        row["segmentation"] = {"size": size, "counts": seen["mask_modal"]}
        row["area"] = float(seen["visible_px"])
    return row


@register
class Coco(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "coco"
    summary: ClassVar = "COCO: instances with boxes and masks; panoptic segments."
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
        self._rows: dict[tuple[Split, str], JsonRows] = {}

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs and open the tables of each split."""
        for episode in episodes:
            require_labels(episode, self.options, "2d")
            colour_cameras(episode, self.options)
        self._folder = folder / "annotations"
        self._splits = self.used_splits(episodes)
        for split in self._splits:
            (folder / split).mkdir()
            (self._folder / f"panoptic_{split}").mkdir(parents=True)
            for table in ("images", "annotations", "panoptic_images", "panoptic"):
                path = self._folder / f".{table}_{split}.json"
                rows = self._rows[split, table] = JsonRows(path)
                self.files.callback(rows.close)
        self._images = self._annotations = 0

    def begin_episode(self, episode: Episode) -> CocoWriter:
        """All frames of an episode go to one split."""
        cameras = tuple(camera.id for camera in colour_cameras(episode, self.options))
        self._split = self.split_of(episode)
        return CocoWriter(self.options, cameras, self._split)

    def add(self, part: tuple[CocoPart, ...]) -> None:
        """Number pictures and objects, from 1."""
        split = self._split
        for picture in part:
            self._images += 1
            image = {"id": self._images, **picture.image}
            self._rows[split, "images"].add(image)
            for annotation in picture.annotations:
                self._annotations += 1
                row = {"id": self._annotations, "image_id": self._images, **annotation}
                self._rows[split, "annotations"].add(row)
            if picture.segments is not None:
                self._rows[split, "panoptic_images"].add(image)
                self._rows[split, "panoptic"].add(
                    {
                        "image_id": self._images,
                        "file_name": Path(image["file_name"]).stem + ".png",
                        "segments_info": picture.segments,
                    }
                )

    def end_episode(self) -> None:
        """Nothing is kept per episode."""

    def finish(self) -> None:
        """Join the tables of each split into COCO's documents; without rows there is none."""
        rows = categories(self.options)
        for split in self._splits:
            self._join("instances", split, "images", "annotations", rows)
            self._join("panoptic", split, "panoptic_images", "panoptic", panoptic_categories())
            for folder in (self._folder / f"panoptic_{split}", self._folder.parent / split):
                if not any(folder.iterdir()):
                    folder.rmdir()

    def _join(
        self, name: str, split: Split, images: str, annotations: str, categories: Sequence[Row]
    ) -> None:
        tables = [self._rows[split, images], self._rows[split, annotations]]
        if tables[0].count == 0:
            for table in tables:
                table.close()
                table.path.unlink()
            return
        with (self._folder / f"{name}_{split}.json").open("w", encoding="utf-8") as file:
            file.write(
                '{"info": {"description": "exported by Car-STAGE"}, "licenses": [],\n'
                f'"categories": {json.dumps(categories)},\n"images": '
            )
            tables[0].move_into(file)
            file.write(', "annotations": ')
            tables[1].move_into(file)
            file.write("}\n")


def _supercategory(name: str) -> str:
    if name.startswith("walker") or name == RIDER:
        return "person"
    if name.startswith("traffic"):
        return "traffic"
    return "vehicle" if name in VEHICLES else "level"
