"""A server's application over an analytic dataset, shared; fake runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from analytic_dataset import make_dataset
from sites import FakeRun, Site, open_site


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """One dataset in a root; tests leave it as it is."""
    folder = tmp_path_factory.mktemp("site")
    root = folder / "datasets"
    root.mkdir()
    dataset = make_dataset(root / "town", folder / "work")
    episode = next((dataset / "commits").glob("*.json")).stem
    with open_site(root) as client:
        yield Site(client, root, "town", episode)


@pytest.fixture(scope="session")
def demo(site: Site) -> dict[str, Any]:
    """The demonstration's configuration."""
    config: dict[str, Any] = site.client.get("/api/schema").json()["demo"]
    return config


@pytest.fixture
def fake_run(tmp_path: Path, demo: dict[str, Any]) -> Iterator[FakeRun]:
    """A run that lives, in the dataset ``drives`` of ``tmp_path / "datasets"``."""
    run = FakeRun(tmp_path / "datasets" / "drives", "20260101-000000-abcdef", demo)
    yield run
    run.end()
