"""Pictures of colour cameras, copied without a change wherever the format allows it."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from carstage.dataset.saved_frames import Frame
from carstage.files.bounded import read_bounded


def copy_picture(frame: Frame, camera_id: str, stem: Path) -> Path:
    """Copy the picture as it is; returns ``stem`` with the suffix of its format."""
    source = frame.image_file(camera_id)
    target = stem.with_name(stem.name + source.suffix)
    target.write_bytes(read_bounded(source))
    return target


def copy_as_png(frame: Frame, camera_id: str, target: Path) -> None:
    """Copy the picture, as PNG even if it was recorded as JPEG."""
    source = frame.image_file(camera_id)
    if source.suffix == ".png":
        target.write_bytes(read_bounded(source))
    else:
        Image.fromarray(frame.read(camera_id)).save(target, "PNG")
