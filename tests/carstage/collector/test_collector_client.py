"""What the collector says of its client."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

carla = pytest.importorskip("carla")
from carstage.collector.client import client_version  # noqa: E402


@pytest.mark.parametrize(
    ("records", "found"),
    [
        (["carla-0.9.13.dist-info", "other-1.0.dist-info"], "0.9.13"),
        (["carla-0.9.13.dist-info", "carla-0.9.16.dist-info"], version("carla")),
        ([], version("carla")),
    ],
)
def test_the_wheels_record_beside_the_client_tells_its_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, records: list[str], found: str
) -> None:
    monkeypatch.setattr(carla, "__file__", str(tmp_path / "carla" / "__init__.py"))
    for name in records:
        (tmp_path / name).mkdir()
    assert client_version() == found


def test_a_client_within_an_archive_has_its_version_from_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    egg = tmp_path / "carla.egg"
    egg.write_bytes(b"")
    monkeypatch.setattr(carla, "__file__", str(egg / "carla" / "__init__.py"))
    assert client_version() == version("carla")
