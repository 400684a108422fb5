"""FIFOs, sockets, sparse and huge files in a dataset are refused before they are read."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from analytic_dataset import attempt_of, make_dataset, recommit
from carstage.dataset import Dataset
from carstage.errors import BadInputError, DatasetError
from carstage.exporters import export_dataset
from carstage.validation import validate_dataset

pytestmark = pytest.mark.timeout(60)  # opening a FIFO waits for ever
PICTURE = "sensors/CAM_FRONT/000002.png"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_dataset(tmp_path / "out", tmp_path / "raw", steps=3)


def fifo(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def listening_socket(path: Path) -> None:
    path.unlink()
    with socket.socket(socket.AF_UNIX) as server:
        place = os.open(path.parent, os.O_RDONLY)  # a whole path may be too long for a socket
        server.bind(f"/proc/self/fd/{place}/{path.name}")
        os.close(place)


def directory(path: Path) -> None:
    path.unlink()
    path.mkdir()


def sparse(path: Path) -> None:
    path.unlink()
    with path.open("wb") as file:
        file.truncate(1 << 42)


ODD: list[Callable[[Path], None]] = [fifo, listening_socket, directory, sparse]


@pytest.mark.parametrize("make", ODD)
@pytest.mark.parametrize("name", [PICTURE, "objects.parquet", "episode.json", "frames.parquet"])
def test_validation_names_the_file_and_goes_on(
    folder: Path, make: Callable[[Path], None], name: str
) -> None:
    make(attempt_of(folder) / name)
    report = validate_dataset(folder)
    assert not report.ok
    named = [problem for problem in report.problems if name in problem.message]
    assert {problem.check for problem in named} & {"file_missing", "file_size"}


def test_a_huge_file_is_refused_though_its_marker_says_so(folder: Path) -> None:
    path = attempt_of(folder) / PICTURE
    (marker,) = (folder / "commits").glob("*.json")
    recommit(folder)
    size = path.stat().st_size
    sparse(path)
    marker.write_text(marker.read_text().replace(f'"bytes": {size}', f'"bytes": {1 << 42}'))
    report = validate_dataset(folder)
    assert any(PICTURE in problem.message for problem in report.problems)
    with pytest.raises(DatasetError, match="are more than"):
        Dataset(folder).episodes[0].sensor("CAM_FRONT").read(2)


@pytest.mark.parametrize("make", ODD)
def test_an_export_refuses_them(folder: Path, tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(attempt_of(folder) / PICTURE)
    with pytest.raises(BadInputError):
        export_dataset("coco", folder, tmp_path / "coco", workers=0)


@pytest.mark.parametrize("make", ODD)
@pytest.mark.parametrize("what", ["dataset.json", "marker"])
def test_reading_refuses_them(folder: Path, make: Callable[[Path], None], what: str) -> None:
    path = next((folder / "commits").glob("*.json")) if what == "marker" else folder / what
    make(path)
    with pytest.raises(DatasetError, match="cannot be read"):
        _ = Dataset(folder).episodes
