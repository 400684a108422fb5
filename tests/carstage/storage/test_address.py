"""Addresses of datasets: folders of this machine, everything else refused by name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import carstage
from carstage.errors import BadInputError
from carstage.storage import RemotePath, dataset_root, local_folder

ELSEWHERE = ("sftp://host/x", "https://h/x", "hdfs://name/x", "ftp://user:word@host/x")


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
def test_other_stores_are_refused_by_name_with_what_to_use(address: str) -> None:
    scheme = address.partition(":")[0]
    for given in (address, Path(address)):
        with pytest.raises(BadInputError, match=rf"cannot be at {scheme}://") as caught:
            dataset_root(given)
        assert "folder" in caught.value.hint or "s3://" in caught.value.hint
        assert "word" not in str(caught.value)


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("s3://bucket/a/b", "s3://bucket/a/b"),
        ("S3://bucket//a/", "s3://bucket/a"),
        ("gs://bucket", "gs://bucket"),
        ("az://container/x y", "az://container/x y"),
        (Path("s3://bucket/a"), "s3://bucket/a"),
    ],
)
def test_a_place_in_an_object_store(address: str | Path, place: str) -> None:
    assert dataset_root(address) == RemotePath(place)


@pytest.mark.parametrize(
    "address", ["s3://", "s3://b", "s3://-x/y", "s3://bucket/../x", "gs://bucket/a\nb", "az:///x"]
)
def test_what_names_no_bucket_or_leaves_it_is_refused(address: str) -> None:
    with pytest.raises(BadInputError, match="is no name"):
        dataset_root(address)


@pytest.mark.parametrize(
    "address", ["s3://me:word@bucket/x", "s3://bucket/x?key=word", "gs://bucket/x#word"]
)
def test_credentials_and_options_do_not_belong_into_an_address(address: str) -> None:
    with pytest.raises(BadInputError, match="a bucket and a path alone") as caught:
        dataset_root(address)
    assert "word" not in str(caught.value)


def test_some_things_have_to_be_on_this_machine() -> None:
    with pytest.raises(BadInputError, match="a folder on this machine"):
        local_folder("s3://bucket/x")


def test_another_machine_is_refused() -> None:
    with pytest.raises(BadInputError, match="'host' is another machine"):
        local_folder("file://host/data")


def test_the_front_door_refuses_and_makes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for call in (
        lambda: carstage.run({}, "sftp://bucket/x"),
        lambda: carstage.Dataset("sftp://bucket/x"),
        lambda: carstage.validate("sftp://bucket/x"),
        lambda: carstage.export("coco", "sftp://bucket/x", "out"),
    ):
        with pytest.raises(BadInputError, match="cannot be at sftp://"):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ("demo", "--out", "sftp://bucket/x"),
        ("validate", "sftp://bucket/x"),
        ("report", "https://bucket/x"),
        ("export", "coco", "datasets/demo", "sftp://bucket/x"),
        ("export", "coco", "sftp://bucket/x", "out"),
        ("gui", "--no-browser", "--datasets", "sftp://bucket/x"),
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
