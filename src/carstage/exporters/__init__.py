"""Datasets in other formats: KITTI, nuScenes, COCO, YOLO, MCAP, 123D, WebDataset; maps in two.

``export_dataset`` runs an ``Exporter`` over a dataset; how to add one stands in
docs/formats/exports.md. ``export_maps`` writes the towns alone. What is listed here is imported
when it is first used: the command line knows ``ExportOptions`` before it knows that something is to
be exported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.dataset import EpisodeFrames, Frame
    from carstage.exporters.class_map import ClassMap, read_class_map
    from carstage.exporters.completeness import Completeness, examine
    from carstage.exporters.exporter import (
        Exporter,
        FrameWriter,
        exporter_for,
        exporters,
        register,
    )
    from carstage.exporters.exporting import ExportSummary, export_dataset
    from carstage.exporters.options import ExportOptions
    from carstage.exporters.town_maps import MAP_FORMATS, export_maps

__all__ = [
    "MAP_FORMATS",
    "ClassMap",
    "Completeness",
    "EpisodeFrames",
    "ExportOptions",
    "ExportSummary",
    "Exporter",
    "Frame",
    "FrameWriter",
    "examine",
    "export_dataset",
    "export_maps",
    "exporter_for",
    "exporters",
    "read_class_map",
    "register",
]

__getattr__ = lazy_names(
    __name__,
    {
        "class_map": "ClassMap read_class_map",
        "completeness": "Completeness examine",
        "exporter": "Exporter Frame FrameWriter exporter_for exporters register",
        "exporting": "EpisodeFrames ExportSummary export_dataset",
        "options": "ExportOptions",
        "town_maps": "MAP_FORMATS export_maps",
    },
)
