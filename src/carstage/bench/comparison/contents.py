"""What a program's first files hold, in a form in which programs can be compared."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray
from PIL import Image

from carstage.bench.clients.boxes_file import BOXES_FILE

FRAMES = 4
_DIGEST_BYTES = 8


def contents_of(folder: Path, document: Mapping[str, Any]) -> dict[str, Any]:
    """Digests of pictures and point clouds by ``sensor/frame``, and rows of boxes.

    Args:
        folder: of a run.
        document: its configuration.
    """
    found: dict[str, Any] = {}
    for sensor in document["rig"]["sensors"]:
        for path in _first_files(folder, sensor["id"]):
            name = f"{sensor['id']}/{int(path.stem)}"
            try:
                content = _array(path, sensor["kind"])
            except (OSError, ValueError, EOFError) as error:
                found[name] = f"unreadable: {error}"  # which no other program's is equal to
                continue
            if content is not None:
                digest = hashlib.blake2b(content.tobytes(), digest_size=_DIGEST_BYTES)
                found[name] = digest.hexdigest()
    boxes = list(_boxes(folder))
    if boxes:
        found["boxes"] = boxes
    return found


def _first_files(folder: Path, sensor: str) -> list[Path]:
    places = [folder / "files" / sensor, *folder.glob(f"dataset/episodes/*/*/sensors/{sensor}")]
    files = [path for place in places for path in place.glob("*.*")]
    return [path for path in sorted(files) if path.stem.isdecimal() and int(path.stem) < FRAMES]


def _array(path: Path, kind: str) -> NDArray[Any] | None:
    """A picture as ``(H, W, 3)`` or what is coded in it, a cloud as float32; None: lossy."""
    if path.suffix == ".npy":
        return np.asarray(np.load(path), np.float32)
    if path.suffix == ".bin":
        return np.fromfile(path, "<f4")
    if path.suffix not in (".png", ".tiff"):
        return None
    with Image.open(path) as image:
        pixels = np.asarray(image)
    if kind == "instance":  # of which the tag is a file of its own in a dataset
        codes = pixels.astype(np.uint16)
        return codes if codes.ndim == 2 else codes[..., 1] + (codes[..., 2] << 8)
    if kind == "semantic":
        return pixels if pixels.ndim == 2 else np.ascontiguousarray(pixels[..., 0])
    return np.ascontiguousarray(pixels[..., :3])


def _boxes(folder: Path) -> Iterator[list[float]]:
    """Frame, actor, x0, y0, x1, y1, visible corners and level of boxes that are whole in view."""
    table = folder / "files" / BOXES_FILE
    if table.exists():
        with table.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if int(row["k"]) < FRAMES and row["whole"] == "1":
                    names = ("k", "track_id", "x0", "y0", "x1", "y1", "n_visible", "occluded")
                    yield [round(float(row[name]), 3) for name in names]
    for path in folder.glob("dataset/episodes/*/*/camera_objects.parquet"):
        for row in pq.read_table(path).to_pylist():
            whole = row["n_outside"] == 0 and row["n_behind"] == 0
            if row["k"] < FRAMES and whole and row["bbox_amodal"] is not None:
                box = [round(value, 3) for value in row["bbox_amodal"]]
                yield [row["k"], row["track_id"], *box, row["n_visible"], row["occluded"]]
