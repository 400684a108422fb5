"""What is kept to be used again: whole or not at all, and no longer than it is of use."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from carstage_sim.cache import CACHE_VARIABLE, UNUSED_S, mark_used, prune, written_atomically
from carstage_sim.maps.cache import prune as prune_towns

DAY_S = 86_400.0


def kept(path: Path, age_s: float) -> Path:
    """A file that was last used so long ago."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"kept")
    used_s = time.time() - age_s
    os.utime(path, (used_s, used_s))
    return path


def write_half(path: Path) -> None:
    with written_atomically(path) as file:
        file.write(b"half")
        raise OSError("full")


def test_a_failed_write_leaves_the_old_file_and_no_draft(tmp_path: Path) -> None:
    path = kept(tmp_path / "new" / "town.npz", 0.0)
    with pytest.raises(OSError, match="full"):
        write_half(path)
    assert [entry.read_bytes() for entry in path.parent.iterdir()] == [b"kept"]


def test_a_written_file_can_be_read_by_whoever_may_read_new_files(tmp_path: Path) -> None:
    plain = kept(tmp_path / "plain", 0.0)
    with written_atomically(tmp_path / "shared") as file:
        file.write(b"whole")
    assert (tmp_path / "shared").read_bytes() == b"whole"
    assert (tmp_path / "shared").stat().st_mode == plain.stat().st_mode


def test_what_was_not_used_for_a_month_goes_and_recordings_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    old = UNUSED_S + DAY_S
    for folder in ("meshes", "trees", "recordings"):
        kept(tmp_path / folder / "old", old)
        kept(tmp_path / folder / "new", old - 2.0 * DAY_S)
    kept(tmp_path / "meshes" / "a.npz.0123.part", 2.0 * DAY_S)
    kept(tmp_path / "meshes" / "b.npz.0123.part", 60.0)
    mark_used(kept(tmp_path / "trees" / "used", old))
    kernels = kept(tmp_path / "kernels" / "render-0" / "a.nbc", 0.0).parent
    os.utime(kernels, (0.0, 0.0))
    prune()
    left = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert left == [
        "meshes/b.npz.0123.part",
        "meshes/new",
        "recordings/new",
        "recordings/old",
        "trees/new",
        "trees/used",
    ]
    assert not kernels.exists()


def test_drafts_of_killed_bakes_go_with_the_towns(tmp_path: Path) -> None:
    kept(tmp_path / "Town-0.npz.0123.part", 2.0 * DAY_S)
    kept(tmp_path / "Town-1.npz.0123.part", 60.0)
    prune_towns(tmp_path)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["Town-1.npz.0123.part"]
