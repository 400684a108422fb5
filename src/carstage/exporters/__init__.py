"""Datasets in other formats: KITTI, nuScenes, COCO, YOLO, MCAP, WebDataset.

``export_dataset`` runs an ``Exporter`` over a dataset; how to add one stands in
docs/formats/exports.md.
"""

from carstage.dataset import EpisodeFrames, Frame
from carstage.exporters.completeness import Completeness, examine
from carstage.exporters.exporter import Exporter, FrameWriter, exporter_for, exporters, register
from carstage.exporters.exporting import ExportSummary, export_dataset
from carstage.exporters.options import ExportOptions
from carstage.exporters.target import check_target

__all__ = [
    "Completeness",
    "EpisodeFrames",
    "ExportOptions",
    "ExportSummary",
    "Exporter",
    "Frame",
    "FrameWriter",
    "check_target",
    "examine",
    "export_dataset",
    "exporter_for",
    "exporters",
    "register",
]
