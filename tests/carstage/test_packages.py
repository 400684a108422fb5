"""Versions of packages are those that ``importlib.metadata`` gives."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path

import pytest

from carstage.packages import installed_version


def test_all_packages_here_have_the_version_that_their_records_say() -> None:
    names = {record.metadata["Name"] for record in distributions()}
    assert {name: installed_version(name) for name in names} == {
        name: version(name) for name in names
    }


def test_records_of_other_forms_are_read_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, file in (("odd-1.egg-info", "PKG-INFO"), ("even-1.dist-info", "METADATA")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_text("Name: x\nversion: 1.5\n\nVersion: 9\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    assert installed_version("odd") == "1.5"
    assert installed_version("even") == "1.5"


def test_a_package_that_is_not_installed_is_named() -> None:
    with pytest.raises(PackageNotFoundError, match="no-such-package"):
        installed_version("no-such-package")
