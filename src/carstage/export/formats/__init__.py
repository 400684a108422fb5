"""The formats that ship; importing this registers their exporters."""

from carstage.export.formats import (
    coco,
    kitti_object,
    kitti_tracking,
    mcap_files,
    nuscenes,
    webdataset,
    yolo,
)

__all__ = [
    "coco",
    "kitti_object",
    "kitti_tracking",
    "mcap_files",
    "nuscenes",
    "webdataset",
    "yolo",
]
