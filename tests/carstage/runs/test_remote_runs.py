"""Whole runs into an object store: the real command, a real server of objects, the same bytes."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import carstage as package
from carstage.storage import open_store
from carstage.storage.remote_files import remote_files
from driving import carstage, children_that_live, command, wait_for
from object_stores import ObjectServer, localbucket, nanio

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with localbucket(tmp_path_factory.mktemp("localbucket")) as running:
        yield running


@pytest.fixture(autouse=True)
def _environment(server: ObjectServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    remote_files.cache_clear()
    yield
    remote_files.cache_clear()


@pytest.fixture(scope="module")
def recorded(
    server: ObjectServer, tmp_path_factory: pytest.TempPathFactory, small: str, home: Path
) -> tuple[str, Path]:
    """A dataset in the store, and the folder of its runs."""
    address = f"{server.address}/recorded"
    work = tmp_path_factory.mktemp("work")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in server.environment.items():
            patch.setenv(name, value)
        ended = carstage(["run", small, "--out", address, "--work", str(work), "--json"], home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["dataset"] == address
    assert result["episodes"] == {"total": 1, "committed": 1, "skipped": 0, "failed": 0}
    return address, work


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory, small: str, home: Path) -> Path:
    """The same dataset in a folder."""
    out = tmp_path_factory.mktemp("local") / "dataset"
    ended = carstage(["run", small, "--out", str(out)], home)
    assert ended.code == 0, ended.stderr
    return out


def test_a_run_leaves_the_dataset_in_the_store_and_its_logs_here(
    recorded: tuple[str, Path],
) -> None:
    address, work = recorded
    keys = {found.key for found in remote_files(address).below("")}
    tops = {key.partition("/")[0] for key in keys}
    assert tops == {"dataset.json", "commits", "episodes", "maps"}
    (marker,) = open_store(address).committed().values()
    prefix = f"episodes/{marker.episode_id}/{marker.attempt}/"
    listed = {prefix + entry.path for entry in marker.files}
    assert listed == {key for key in keys if key.startswith("episodes/")}
    (run,) = (work / "runs").iterdir()
    assert json.loads((run / "status.json").read_text())["state"] == "done"
    assert not (run / "raw").exists()
    assert not (work / "episodes").exists()


def test_the_same_bytes_come_out_as_on_a_disk(recorded: tuple[str, Path], local: Path) -> None:
    assert open_store(local).committed() == open_store(recorded[0]).committed()


def test_the_same_command_again_records_nothing(
    recorded: tuple[str, Path], small: str, home: Path, tmp_path: Path
) -> None:
    """Also from another machine, which knows nothing of the first run."""
    for work in (recorded[1], tmp_path / "elsewhere"):
        given = ["run", small, "--out", recorded[0], "--work", str(work), "--json"]
        ended = carstage(given, home)
        assert ended.code == 0, ended.stderr
        result = json.loads(ended.stdout.splitlines()[-1])
        assert result["episodes"] == {"total": 1, "committed": 0, "skipped": 1, "failed": 0}


def test_it_is_read_validated_reported_and_exported(
    recorded: tuple[str, Path],
    local: Path,
    home: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CARSTAGE_OBJECT_CACHE_MB", "1")  # far less than the dataset has
    dataset = package.Dataset(recorded[0])
    (episode,) = dataset.episodes
    assert episode.objects().num_rows > 0
    for sensor in episode.sensors:
        sensor.read(0)
    there, together, here = (
        carstage(["validate", *arguments, "--json"], home)
        for arguments in ([recorded[0]], [recorded[0], "--workers", "2"], [str(local)])
    )
    assert there.stdout == together.stdout == here.stdout
    assert json.loads(there.stdout.splitlines()[-1])["figures"]["files"] > 100
    page = tmp_path / "report.html"
    reported = carstage(["report", recorded[0], "--html", str(page)], home)
    assert reported.code == 0, reported.stderr
    assert page.stat().st_size > 10_000
    exported = carstage(["export", "coco", recorded[0], str(tmp_path / "coco")], home)
    assert exported.code == 0, exported.stderr
    assert (tmp_path / "coco" / "export.json").exists()
    place = recorded[0].replace("recorded", "exported")
    for more, code in (([], 0), ([], 2), (["--overwrite"], 0)):
        sent = carstage(["export", "coco", recorded[0], place, *more], home)
        assert sent.code == code, sent.stderr
    names = [path.relative_to(tmp_path / "coco").as_posix() for path in _files(tmp_path / "coco")]
    assert [found.key for found in remote_files(place).below("")] == sorted(names)
    inside = carstage(["export", "coco", recorded[0], f"{recorded[0]}/coco"], home)
    assert inside.code == 2
    assert "lie in one another" in inside.stderr


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_a_killed_run_goes_on_and_leaves_nothing_behind(
    server: ObjectServer, recorded: tuple[str, Path], small: str, home: Path, tmp_path: Path
) -> None:
    address = f"{server.address}/killed"
    given = ["run", small, "--out", address, "--work", str(tmp_path)]
    files = remote_files(address)
    with command(given, home) as running:
        wait_for(lambda: files.has_any("episodes"), "the first files in the store")
        running.process.kill()
        running.end()
    assert open_store(address).committed() == {}
    ended = carstage(given, home)
    assert ended.code == 0, ended.stderr
    (marker,) = open_store(address).committed().values()
    assert marker.attempt == "a2"
    (undisturbed,) = open_store(recorded[0]).committed().values()
    assert marker.files == undisturbed.files
    keys = {found.key for found in files.below("episodes")}
    assert {key.split("/")[2] for key in keys} == {"a2"}
    assert files.below("leases") == []
    assert children_that_live(tmp_path) == []


def test_doctor_looks_at_the_store(recorded: tuple[str, Path], home: Path) -> None:
    looked = carstage(["doctor", "--out", recorded[0]], home)
    assert f"{recorded[0]} can be written and heeds conditions" in looked.stdout
    missing = carstage(["doctor", "--out", "s3://another-bucket/x"], home)
    assert missing.code == 1
    assert "there is no such bucket" in missing.stdout


def test_what_the_store_refuses_is_told_before_anything_starts(
    small: str, home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("nanio", reason="nanio needs Python 3.11")
    with nanio(tmp_path / "nanio") as careless:
        for name, value in careless.environment.items():
            monkeypatch.setenv(name, value)
        given = ["run", small, "--out", f"{careless.address}/x", "--work", str(tmp_path / "work")]
        replaced = carstage(given, home)
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "wrong-" + os.urandom(4).hex())
        refused = carstage(given, home)
    for ended, words in ((replaced, "silently replaces"), (refused, "refuses the credentials")):
        assert ended.code == 2, ended.stderr
        assert words in ended.stderr
    assert not (tmp_path / "work").exists()
    assert not list((tmp_path / "nanio" / "data" / "nanio-bucket").rglob("*.json"))
