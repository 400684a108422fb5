"""What the collector says of its client."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest

carla = pytest.importorskip("carla")
from carstage.collector.client import client_version, is_known_gone  # noqa: E402


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


@pytest.mark.parametrize(
    ("frame", "shown", "gone"), [(0, (), False), (7, (28,), False), (7, (29,), True)]
)
def test_who_is_gone_is_told_by_frames_not_by_what_nobody_has_set(
    frame: int, shown: tuple[int, ...], gone: bool
) -> None:
    snapshot = SimpleNamespace(frame=frame, find=lambda number: number if number in shown else None)
    world = SimpleNamespace(get_snapshot=lambda: snapshot)
    assert is_known_gone(world, SimpleNamespace(id=28, is_alive=not gone)) is gone
    assert is_known_gone(world, SimpleNamespace(id=28, is_alive=gone)) is gone
