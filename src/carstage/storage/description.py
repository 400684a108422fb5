"""``dataset.json``: format version, name and the table of semantic tags."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.errors import DatasetError

FORMAT_VERSION = 1

# CARLA's labels from 0.9.14 on (Docs/ref_sensors.md), in the order of their numbers.
TAG_TABLE = (
    ("Unlabeled", (0, 0, 0)),
    ("Roads", (128, 64, 128)),
    ("SideWalks", (244, 35, 232)),
    ("Building", (70, 70, 70)),
    ("Wall", (102, 102, 156)),
    ("Fence", (190, 153, 153)),
    ("Pole", (153, 153, 153)),
    ("TrafficLight", (250, 170, 30)),
    ("TrafficSign", (220, 220, 0)),
    ("Vegetation", (107, 142, 35)),
    ("Terrain", (152, 251, 152)),
    ("Sky", (70, 130, 180)),
    ("Pedestrian", (220, 20, 60)),
    ("Rider", (255, 0, 0)),
    ("Car", (0, 0, 142)),
    ("Truck", (0, 0, 70)),
    ("Bus", (0, 60, 100)),
    ("Train", (0, 80, 100)),
    ("Motorcycle", (0, 0, 230)),
    ("Bicycle", (119, 11, 32)),
    ("Static", (110, 190, 160)),
    ("Dynamic", (170, 120, 50)),
    ("Other", (55, 90, 80)),
    ("Water", (45, 60, 150)),
    ("RoadLine", (157, 234, 50)),
    ("Ground", (81, 0, 81)),
    ("Bridge", (150, 100, 100)),
    ("RailTrack", (230, 150, 140)),
    ("GuardRail", (180, 165, 180)),
)


def describe_dataset(name: str) -> bytes:
    """The content of a new ``dataset.json``."""
    document = {
        "format_version": FORMAT_VERSION,
        "name": name,
        "created_by": f"carstage {__version__}",
        "tags": [
            {"value": value, "name": tag, "rgb": list(rgb)}
            for value, (tag, rgb) in enumerate(TAG_TABLE)
        ],
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def read_description(path: Path) -> dict[str, Any]:
    """The content of an existing ``dataset.json``.

    Raises:
        DatasetError: there is none, it is damaged, or its format version is not ours.
    """
    try:
        document = json.loads(path.read_bytes())
        version = document["format_version"]
    except FileNotFoundError as error:
        raise DatasetError(
            f"{path.parent} is no Car-STAGE dataset: it has no {path.name}.",
            "Name the folder that was given as --out.",
        ) from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"{path} cannot be read: {error}.", "Name another folder or restore the file."
        ) from error
    if version != FORMAT_VERSION:
        raise DatasetError(
            f"{path} has format version {version!r}; this Car-STAGE knows {FORMAT_VERSION}.",
            "Install the version of Car-STAGE that wrote it.",
        )
    return dict(document)
