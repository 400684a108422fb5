"""The formats of exports and what they need, known without importing them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

FORMATS: Mapping[str, tuple[str, str | None]] = {
    "kitti-object": ("KITTI object detection", None),
    "kitti-stereo": ("KITTI stereo", None),
    "kitti-tracking": ("KITTI tracking", None),
    "semantickitti": ("SemanticKITTI", None),
    "nuscenes": ("nuScenes", None),
    "opv2v": ("OPV2V (OpenCOOD)", None),
    "coco": ("COCO", None),
    "yolo": ("YOLO", None),
    "webdataset": ("WebDataset", None),
    "123d": ("123D", None),
    "mcap": ("MCAP (Foxglove, Lichtblick)", "mcap"),
    "video": ("Video", "video"),
}
"""Name to title and to the extra of the package that it needs."""

_MODULES = {"mcap": ("mcap", "foxglove_schemas_protobuf"), "video": ("av",)}


def available(extra: str | None) -> bool:
    """Whether what an extra brings is installed."""
    return all(find_spec(module) is not None for module in _MODULES.get(extra or "", ()))
