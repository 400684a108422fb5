"""A dataset and a raw log of version 0.1 stay of use; see tests/data/version-0.1/README.md."""

from __future__ import annotations

import json
import shutil
import tarfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from benchmarks.framework.same_contents import compare_datasets
from carstage.conversion import EpisodeConversion
from carstage.dataset import Dataset
from carstage.exporters import ExportOptions, export_dataset
from carstage.storage import LocalStore
from carstage.validation import validate_dataset
from driving import Ended, carstage

_DATA = Path(__file__).parents[1] / "data" / "version-0.1"
_WITH_RAW_LOG = "722c1de1cc6d1c15"
_OTHER = "5b9c3b28e7ff7dcb"
_FRAMES = 3


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """The dataset, to change as one likes."""
    with tarfile.open(_DATA / "dataset.tar.gz") as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / "dataset"


def test_it_is_read(old: Path) -> None:
    dataset = Dataset(old)
    assert {episode.id for episode in dataset.episodes} == {_WITH_RAW_LOG, _OTHER}
    for episode in dataset.episodes:
        assert episode.frames == _FRAMES
        assert len(episode.sensors) == 11
        for sensor in episode.sensors:
            for k in range(_FRAMES):
                assert sensor.read(k).size
        for table in (episode.objects(), episode.camera_objects()):
            assert table.num_rows > _FRAMES
        for table in (episode.ledger(), episode.ego()):
            assert table.num_rows == _FRAMES
    assert len(list(dataset.iter_frames())) == 2 * _FRAMES


def test_it_is_valid_by_its_sha256(old: Path) -> None:
    markers = LocalStore(old).committed().values()
    assert all(entry.hash.startswith("sha256:") for m in markers for entry in m.files)
    report = validate_dataset(old)
    assert [problem for problem in report.problems if problem.severity == "error"] == []


def test_damage_is_found_by_its_sha256(old: Path) -> None:
    file = old / "episodes" / _OTHER / "a1" / "sensors" / "LIDAR" / "000001.bin"
    file.write_bytes(bytes(8) + file.read_bytes()[8:])
    assert "file_hash" in {problem.check for problem in validate_dataset(old).problems}


@pytest.mark.parametrize("name", ["kitti-object", "nuscenes", "coco"])
def test_it_is_exported(old: Path, tmp_path: Path, name: str) -> None:
    summary = export_dataset(name, old, tmp_path / name, ExportOptions(), workers=0)
    assert summary.frames == 2 * _FRAMES
    assert any((tmp_path / name).rglob("*.*"))


def test_its_raw_log_is_converted_into_the_same_contents(old: Path, tmp_path: Path) -> None:
    (raw,) = old.glob(f"runs/*/raw/{_WITH_RAW_LOG}/a1")
    anew = LocalStore(tmp_path / "anew")
    anew.initialise("anew")
    with ThreadPoolExecutor(2) as pool:
        conversion = EpisodeConversion(raw, anew.attempt_files(_WITH_RAW_LOG, "a1"), pool)
        conversion.finish()
    anew.commit(_WITH_RAW_LOG, "a1", frames=_FRAMES, versions={})
    (old / "commits" / f"{_OTHER}.json").unlink()
    found = compare_datasets(old, anew.root)
    # Version 0.1 took numpy's arctan2, whose last bit depends on the processor.
    assert found.differences == ["table camera_objects, column alpha"]
    before, now = (
        Dataset(root).episodes[0].camera_objects()["alpha"].to_numpy() for root in (old, anew.root)
    )
    np.testing.assert_allclose(now, before, rtol=0.0, atol=1e-15)
    # Columns that came later.
    assert found.renamed == {"camera_objects.outside_px", "frames.CAM_FRONT.labels"}
    assert found.data == 11 * _FRAMES
    assert found.rows > 0


def _run(dataset: Path, home: Path) -> Ended:
    config = _DATA / "config.yaml"
    return carstage(["run", str(config), "--out", str(dataset), "--json"], home)


def _contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.end_to_end
@pytest.mark.xdist_group("runs")
def test_what_is_committed_is_not_recorded_again(old: Path, tmp_path: Path) -> None:
    before = _contents(old / "episodes"), _contents(old / "commits")
    ended = _run(old, tmp_path)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"] == {"total": 2, "committed": 0, "skipped": 2, "failed": 0}
    assert (_contents(old / "episodes"), _contents(old / "commits")) == before


@pytest.mark.end_to_end
@pytest.mark.xdist_group("runs")
def test_only_the_missing_episode_is_recorded(old: Path, tmp_path: Path) -> None:
    (old / "commits" / f"{_OTHER}.json").unlink()
    shutil.rmtree(old / "episodes" / _OTHER)
    before = _contents(old / "episodes" / _WITH_RAW_LOG)
    ended = _run(old, tmp_path)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"] == {"total": 2, "committed": 1, "skipped": 1, "failed": 0}
    assert _contents(old / "episodes" / _WITH_RAW_LOG) == before
    markers = LocalStore(old).committed()
    assert sorted(markers) == sorted([_WITH_RAW_LOG, _OTHER])
    algorithms = {
        name: {entry.hash.partition(":")[0] for entry in marker.files}
        for name, marker in markers.items()
    }
    assert algorithms == {_WITH_RAW_LOG: {"sha256"}, _OTHER: {"blake3"}}
    report = validate_dataset(old)
    assert [problem for problem in report.problems if problem.severity == "error"] == []
