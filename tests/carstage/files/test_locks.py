"""A lock is one process's, and goes with its handle."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.files.locks import take_lock


def test_a_held_file_is_refused_until_it_is_given_back(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    held = take_lock(path, 0o600)
    assert held is not None
    assert path.stat().st_mode & 0o777 == 0o600
    assert take_lock(path, 0o600) is None
    held.close()
    again = take_lock(path, 0o600)
    assert again is not None
    again.close()


def test_a_place_that_cannot_be_used_is_an_error_and_not_a_held_lock(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="lock"):
        take_lock(tmp_path / "missing" / "lock", 0o600)
