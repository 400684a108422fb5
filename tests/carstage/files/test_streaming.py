"""Files written past the page cache hold what was given, whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import mmap
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.files.streaming import FileStream

_BLOCK = 4096
_SMALL = 1000
_LARGE = 3 * (1 << 19)
SIZES = (0, 1, _SMALL, (1 << 19) - 1, 1 << 19, (1 << 19) + 1, _LARGE, _LARGE + _BLOCK - 1)


def contents() -> dict[str, bytes]:
    """Something of every size, by file name."""
    return {f"{size}.bin": os.urandom(size) for size in SIZES}


def address(content: memoryview) -> int:
    return int(np.frombuffer(content, np.uint8).ctypes.data)


def written(folder: Path, files: Mapping[str, bytes | memoryview]) -> dict[str, bytes]:
    """What is in the folder after all were written."""
    with FileStream() as stream:
        for name, content in files.items():
            stream.write(folder / name, memoryview(content))
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_every_size_is_written_whole(tmp_path: Path) -> None:
    files = contents()
    assert written(tmp_path, files) == files


def test_content_replaces_what_stood_there(tmp_path: Path) -> None:
    for files in (contents(), contents()):
        assert written(tmp_path, files) == files


def test_large_files_are_written_past_the_page_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    direct = 0

    def pwrite(descriptor: int, content: memoryview, offset: int) -> int:
        nonlocal direct
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_DIRECT:
            direct += len(content)
        return real(descriptor, content, offset)

    real = os.pwrite
    monkeypatch.setattr(os, "pwrite", pwrite)
    files = {"a.bin": os.urandom(_LARGE + 7), "b.bin": os.urandom(_SMALL)}
    assert written(tmp_path, files) == files
    assert direct in (0, _LARGE)
    if not direct:
        pytest.skip(f"the file system of {tmp_path} has no direct writes")


def test_what_begins_at_a_block_of_memory_is_written_as_it_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = []

    def pwrite(descriptor: int, content: memoryview, offset: int) -> int:
        places.append(address(content) - offset)
        return real(descriptor, content, offset)

    real = os.pwrite
    monkeypatch.setattr(os, "pwrite", pwrite)
    with mmap.mmap(-1, 2 * _LARGE) as mapped:
        mapped[:] = os.urandom(2 * _LARGE)
        for begin in (0, 16):
            places.clear()
            content = memoryview(mapped)[begin : begin + _LARGE + 7]
            assert written(tmp_path, {"a.bin": content}) == {"a.bin": bytes(content)}
            assert (set(places) == {address(content)}) == (begin == 0)
            content.release()


def refuse_flag(real: Callable[..., int]) -> Callable[..., int]:
    """``fcntl`` where a file system takes no direct writes."""

    def call(descriptor: int, command: int, argument: int = 0) -> int:
        if command == fcntl.F_SETFL and argument & os.O_DIRECT:
            raise OSError(errno.EINVAL, "no direct writes")
        return real(descriptor, command, argument)

    return call


@pytest.mark.parametrize("blocks_before", [0, 1])
def test_a_file_system_may_refuse_a_direct_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, blocks_before: int
) -> None:
    real, calls = os.pwrite, 0

    def pwrite(descriptor: int, content: memoryview, offset: int) -> int:
        nonlocal calls
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_DIRECT:
            calls += 1
            if calls > blocks_before:
                raise OSError(errno.EINVAL, "not like that")
            content = content[:_BLOCK]
        return real(descriptor, content, offset)

    monkeypatch.setattr(os, "pwrite", pwrite)
    files = {"a.bin": os.urandom(_LARGE + 7)}
    assert written(tmp_path, files) == files


def test_a_file_system_may_have_no_direct_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fcntl, "fcntl", refuse_flag(fcntl.fcntl))
    files = contents()
    assert written(tmp_path, files) == files


def fail_at(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the disk be full when the file of that name is written."""
    real = os.pwrite

    def pwrite(descriptor: int, content: Any, offset: int) -> int:
        if Path(f"/proc/self/fd/{descriptor}").readlink().name == f".{name}":
            raise OSError(errno.ENOSPC, "disk full")
        return real(descriptor, content, offset)

    monkeypatch.setattr(os, "pwrite", pwrite)


def test_a_failure_keeps_what_stood_there_and_leaves_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "b.bin").write_bytes(b"old")
    fail_at("b.bin", monkeypatch)
    with pytest.raises(OSError, match="disk full"):
        written(tmp_path, {"a.bin": bytes(_LARGE), "b.bin": bytes(_LARGE)})
    assert {path.name: path.stat().st_size for path in tmp_path.iterdir()} == {
        "a.bin": _LARGE,
        "b.bin": 3,
    }


def test_a_failure_is_told_before_many_more_files_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail_at("0.bin", monkeypatch)
    with pytest.raises(OSError, match="disk full"):
        written(tmp_path, {f"{number}.bin": bytes(_LARGE) for number in range(100)})
    assert len(list(tmp_path.iterdir())) < 5


def test_a_block_that_fails_keeps_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail_at("a.bin", monkeypatch)

    def break_off() -> None:
        with FileStream() as stream:
            stream.write(tmp_path / "a.bin", bytes(_LARGE))
            raise ValueError("no picture")

    with pytest.raises(ValueError, match="no picture"):
        break_off()
    assert not list(tmp_path.iterdir())
