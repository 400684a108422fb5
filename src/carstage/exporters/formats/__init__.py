"""The formats that ship; importing this registers their exporters."""

from carstage.exporters.formats import (
    coco,
    kitti_object,
    kitti_stereo,
    kitti_tracking,
    logs_123d,
    mcap_files,
    nuscenes,
    opv2v,
    semantic_kitti,
    video,
    webdataset,
    yolo,
)

__all__ = [
    "coco",
    "kitti_object",
    "kitti_stereo",
    "kitti_tracking",
    "logs_123d",
    "mcap_files",
    "nuscenes",
    "opv2v",
    "semantic_kitti",
    "video",
    "webdataset",
    "yolo",
]
