"""Temporary files go with their owner, whatever ends it, and never while it lives."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from carstage.files.scratch import Scratch

OWNER = """
import sys, time
from carstage.files.scratch import Scratch
one, two = Scratch("mine-"), Scratch("mine-", ".log", folder=False)
(one.path / "below").mkdir()
print(one.path, two.path, flush=True)
{end}
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def owner(end: str) -> tuple[subprocess.Popen[str], list[Path]]:
    process = subprocess.Popen(
        [sys.executable, "-c", OWNER.format(end=end)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, [Path(text) for text in process.stdout.readline().split()]


@pytest.mark.parametrize("folder", [True, False])
def test_it_is_gone_after_its_block(temporary: Path, folder: bool) -> None:
    with Scratch("mine-", folder=folder) as scratch:
        assert scratch.path.parent == temporary
        assert scratch.path.is_dir() == folder
        assert scratch.path.stat().st_mode & 0o077 == 0
    assert not scratch.path.exists()
    scratch.remove()


@pytest.mark.parametrize("end", ["", "raise SystemExit(3)", "raise KeyError"])
def test_it_goes_with_the_process_that_forgot_it(temporary: Path, end: str) -> None:
    process, paths = owner(end)
    with process:
        process.wait(60)
    assert len(paths) == 2
    assert not list(temporary.iterdir())


def test_what_a_killed_process_left_goes_with_the_next_that_is_made(temporary: Path) -> None:
    other = temporary / "mine"  # does not begin so
    other.mkdir()
    process, paths = owner("time.sleep(600)")
    with process:
        with Scratch("mine-"):
            assert all(path.exists() for path in paths)  # its owner lives
        process.send_signal(signal.SIGKILL)
    assert all(path.exists() for path in paths)
    with Scratch("mine-", ".log", folder=False):
        assert [path.exists() for path in paths] == [True, False]
    with Scratch("mine-") as scratch:
        assert sorted(temporary.iterdir()) == sorted([other, scratch.path])


def test_a_link_is_not_followed(temporary: Path) -> None:
    kept = temporary / "kept"
    kept.mkdir()
    (kept / "file").touch()
    (temporary / "mine-link").symlink_to(kept)
    Scratch("mine-").remove()
    assert (kept / "file").exists()


def test_nobody_takes_one_that_is_just_being_made(temporary: Path) -> None:
    wrong: list[str] = []

    def make() -> None:
        for _ in range(60):
            with Scratch("mine-") as scratch:
                if not scratch.path.is_dir():
                    wrong.append(scratch.path.name)

    threads = [threading.Thread(target=make) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert not list(temporary.iterdir())
