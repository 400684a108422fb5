"""Caches and homes where the user's own cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from carstage import cache
from carstage.cache import CACHE_VARIABLE, cache_folder, home_folder, private_folder


@pytest.fixture(autouse=True)
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is known of this machine, and the temporary folder is the test's own."""
    cache.is_usable.cache_clear()
    cache.private_folder.cache_clear()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for name in (CACHE_VARIABLE, "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)


def test_the_users_own_is_taken_where_it_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home" / ".cache" / "carstage"
    assert home_folder() == tmp_path / "home"
    assert CACHE_VARIABLE not in os.environ


def test_without_a_home_a_private_folder_serves_this_process_and_its_children(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("HOME", "/proc/nowhere")
    folder = cache_folder()
    assert folder == private_folder() / "cache"
    assert os.environ[CACHE_VARIABLE] == str(folder)
    assert CACHE_VARIABLE in caplog.text
    assert home_folder() == private_folder()
    assert private_folder().stat().st_mode & 0o077 == 0


def test_a_home_that_is_not_set_is_no_crash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HOME")
    assert home_folder() == private_folder()


def test_a_private_folder_that_others_can_write_is_not_used(tmp_path: Path) -> None:
    taken = tmp_path / f"carstage-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    found = private_folder()
    assert found != taken
    assert found.stat().st_mode & 0o077 == 0


def test_a_private_folder_that_is_a_link_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / f"carstage-{os.getuid()}").symlink_to(tmp_path / "elsewhere")
    assert private_folder() != tmp_path / f"carstage-{os.getuid()}"


LOOK = "from carstage_sim.cache import cache_folder as f; a = f(); print(a, f() == a, a.is_dir())"


def test_the_simulator_without_a_home_keeps_its_caches_for_as_long_as_it_lives() -> None:
    environment = {**os.environ, "HOME": "/proc/nowhere"}
    ended = subprocess.run(
        [sys.executable, "-c", LOOK], env=environment, capture_output=True, text=True, check=True
    )
    path, same, there = ended.stdout.split()
    assert (same, there) == ("True", "True")
    assert CACHE_VARIABLE in ended.stderr
    assert not Path(path).exists()
