"""A real run writes what it commits to the catalog, as `rebuild` would have written it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.framework.postgres_servers import PostgresServer
from carstage.catalog import CATALOG_VARIABLE, Catalog, query_catalog, rebuild, verify
from carstage.catalog.address import parse_address
from carstage.dataset import Dataset

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("postgres")]

CONFIG = """
name: indexed
seed: 5
episodes: 2
duration_s: 0.2
image_size: [80, 60]
vehicles: {count: 3}
server: {self_test: "off"}
"""
ROWS = (
    "SELECT * FROM runs ORDER BY id",
    "SELECT * FROM episodes ORDER BY id",
    "SELECT * FROM attempts ORDER BY episode_id",
    "SELECT * FROM sensors ORDER BY episode, sensor_id",
    "SELECT * FROM artifacts ORDER BY episode, path",
    "SELECT * FROM label_summaries ORDER BY episode, class",
)


def test_the_catalog_beside_a_run_is_the_one_of_its_markers(
    tmp_path: Path, wheel_postgres: PostgresServer
) -> None:
    wheel_postgres.create("catalog")
    config, out = tmp_path / "config.yaml", tmp_path / "out"
    config.write_text(CONFIG)
    done = subprocess.run(
        [sys.executable, "-m", "carstage.cli", "run", config, "--out", out, "--json"],
        env={**os.environ, CATALOG_VARIABLE: wheel_postgres.good_address},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "not in the catalog" not in done.stderr
    run_id = json.loads(done.stdout.splitlines()[-1])["run_id"]
    with Catalog(parse_address(wheel_postgres.good_address, secret=True)) as catalog:
        beside = [query_catalog(catalog, words).to_pylist() for words in ROWS]
        assert [row["run_id"] for row in beside[0]] == [run_id]
        assert [row["run_id"] for row in beside[1]] == [run_id] * 2
        assert list(verify(catalog, Dataset(out), deep=True)) == []
        rebuild(catalog, Dataset(out))
        again = [query_catalog(catalog, words).to_pylist() for words in ROWS]
    for mine, theirs in zip(beside[1:], again[1:], strict=True):
        assert mine == theirs
    assert [{**row, "id": 0} for row in beside[0]] == [{**row, "id": 0} for row in again[0]]
