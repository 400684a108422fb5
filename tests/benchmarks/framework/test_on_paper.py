"""The cost on paper follows from the committed figures, and the documentation shows it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.framework.on_paper import Measured, load_measured, on_paper, table
from benchmarks.registry import app

PAGE = Path(__file__).parents[3] / "docs" / "at-scale.md"

SIMPLE = Measured(
    frames_per_s=2.0,
    cpu_s_per_frame=0.5,
    fixed_objects=10,
    object_bytes=1e5,
    write_requests=2,
    other_requests=8,
    read_ms=4.0,
    plan_s_per_episode=1e-4,
    catalog_per_s=1000.0,
)


def values(measured: Measured, workers: int, frames: int) -> dict[str, str]:
    rows = on_paper(measured, workers=workers, frames=frames, episode_s=60.0)
    return {row.what: row.value for row in rows}


def test_the_rows_follow_from_the_figures() -> None:
    found = values(SIMPLE, 100, 7_200_000)
    assert found["episodes"] == "12,000"
    assert found["hours"] == "10.0"
    assert found["core-hours"] == "1,000"
    assert found["objects"] == "21,720,000"  # 12,000 of 3 * 600 pictures and 10 others
    assert found["terabytes"] == "2.2"
    assert found["requests that write"] == "21,744,000"
    assert found["the same in a second"] == "604"
    assert found["requests to list all markers"] == "12"
    assert found["all begin anew at the end: markers to read"] == "1,200,000"


def test_twice_the_workers_take_half_the_time_and_ask_twice_as_often() -> None:
    one, two = (values(SIMPLE, workers, 7_200_000) for workers in (100, 200))
    assert (one["hours"], two["hours"]) == ("10.0", "5.0")
    assert (one["the same in a second"], two["the same in a second"]) == ("604", "1,208")
    assert one["core-hours"] == two["core-hours"]
    slower = values(replace(SIMPLE, frames_per_s=1.0), 100, 7_200_000)
    assert slower["hours"] == "20.0"


def test_the_page_shows_the_table_of_the_committed_figures() -> None:
    rows = on_paper(load_measured(), workers=1000, frames=10_000_000, episode_s=60.0)
    assert table(rows) in PAGE.read_text("utf-8"), table(rows)
    printed = CliRunner().invoke(app, ["on-paper"])
    assert printed.exit_code == 0
    assert printed.stdout.strip() == table(rows)
