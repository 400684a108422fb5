"""Addresses of datasets: folders of this machine, everything else refused by name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import carstage
from carstage.errors import BadInputError
from carstage.storage import local_folder

ELSEWHERE = (
    "s3://bucket/prefix",
    "gs://bucket",
    "az://container/x",
    "sftp://host/x",
    "https://h/x",
)


@pytest.mark.parametrize(
    ("address", "folder"),
    [
        ("datasets/demo", "datasets/demo"),
        ("/data/a:b", "/data/a:b"),
        ("./s3://x", "s3:/x"),
        ("file:///data/my%20set", "/data/my set"),
        ("file://localhost/data", "/data"),
        ("FILE:///data", "/data"),
        (Path("file:///data"), "/data"),
    ],
)
def test_a_folder_of_this_machine(address: str | Path, folder: str) -> None:
    assert local_folder(address) == Path(folder)


def test_the_users_folder() -> None:
    assert local_folder("~/x") == Path.home() / "x"


@pytest.mark.parametrize("address", ELSEWHERE)
def test_other_stores_are_refused_by_name_with_what_is_supported(address: str) -> None:
    scheme = address.partition(":")[0]
    for given in (address, Path(address)):
        with pytest.raises(BadInputError, match=rf"cannot be at {scheme}://") as caught:
            local_folder(given)
        assert "file:///PATH" in str(caught.value.hint)


def test_another_machine_is_refused() -> None:
    with pytest.raises(BadInputError, match="'host' is another machine"):
        local_folder("file://host/data")


def test_the_front_door_refuses_and_makes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for call in (
        lambda: carstage.run({}, "s3://bucket/x"),
        lambda: carstage.Dataset("s3://bucket/x"),
        lambda: carstage.validate("s3://bucket/x"),
        lambda: carstage.export("coco", "s3://bucket/x", "out"),
    ):
        with pytest.raises(BadInputError, match="cannot be at s3://"):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ("demo", "--out", "s3://bucket/x"),
        ("validate", "s3://bucket/x"),
        ("report", "gs://bucket/x"),
        ("export", "coco", "datasets/demo", "s3://bucket/x"),
        ("export", "coco", "s3://bucket/x", "out"),
        ("gui", "--no-browser", "--datasets", "s3://bucket/x"),
    ],
    ids=" ".join,
)
def test_the_commands_refuse_and_make_nothing(words: tuple[str, ...], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "carstage.cli", *words],
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "datasets cannot be at" in done.stderr
    assert not list(tmp_path.iterdir())
