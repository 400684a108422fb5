"""The measurements in short, against the embedded simulator: what they find, not how fast it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks.framework.busy_machine import measure_busy_machine
from benchmarks.framework.flash_lidar import measure_flash_lidar
from benchmarks.framework.frames_check import check_frames
from benchmarks.framework.globe import measure_globe
from benchmarks.framework.interrupting import measure_interrupting
from benchmarks.framework.memory import measure_memory
from benchmarks.framework.odd_machines import MACHINES, measure_odd_machines
from benchmarks.framework.overhead import measure_overhead
from benchmarks.framework.two_hosts import measure_two_hosts
from benchmarks.framework.warping import measure_warping
from carstage.bench.episodes import looping_server
from carstage.bench.verdict import Verdict
from carstage.errors import BadInputError
from carstage.server import Endpoint
from client_wheels import wheel_python

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("bench")]

SMALL_PICTURE = (96, 54)
"""Of what is compared byte by byte and not looked at."""


@pytest.fixture(scope="module")
def server() -> Iterator[Endpoint]:
    with looping_server(2) as endpoint:
        yield endpoint


def figures(verdict: Verdict) -> dict[str, Any]:
    return {figure.name: figure.value for figure in verdict.figures}


def test_every_frame_of_eight_sensors_is_the_one_that_was_sent(
    server: Endpoint, tmp_path: Path
) -> None:
    reported: list[int] = []
    verdict = check_frames(
        ticks=500,
        scratch=tmp_path,
        running=server,
        progress=lambda done, total: reported.append(done),
    )
    assert verdict.ok, verdict.text()
    assert figures(verdict)["records_compared"] == 4000
    assert reported[-1] == 500


def test_memory_stays_within_the_budget_on_a_slow_disk(server: Endpoint, tmp_path: Path) -> None:
    budget_bytes = 4_000_000
    verdict = measure_memory(
        frames=30,
        budget_bytes=budget_bytes,
        disk_bytes_per_s=3e6,
        scratch=tmp_path,
        running=server,
    )
    found = figures(verdict)
    assert found["frames"] == 30
    # Resident memory of so short a recording says nothing: what is queued is the bound. Three
    # ticks fit in.
    assert 0.5 <= found["largest_queue_of_budget"] <= 1.0


def test_overhead_is_measured_against_a_client_that_drops_everything(
    server: Endpoint, tmp_path: Path
) -> None:
    verdict = measure_overhead(
        ticks=60, rounds=1, size=(64, 36), raw_store="mmap", scratch=tmp_path, running=server
    )
    found = figures(verdict)
    assert found["lidar_points"] >= 100_000
    assert found["client_cpu_ms_per_tick_discarding"] > 0
    assert found["client_cpu_ms_per_tick_capturing"] > 0


def test_a_demo_on_a_busy_machine_has_the_files_of_a_calm_one() -> None:
    verdict = measure_busy_machine(demos=1, per_core=1, seconds=0.3, size=SMALL_PICTURE)
    assert verdict.ok, verdict.text()
    assert figures(verdict)["files_compared"] > 20


def test_flash_lidars_measure_what_rays_along_their_beams_meet() -> None:
    verdict = measure_flash_lidar(["Stage01"], 1.0)
    assert verdict.ok, verdict.text()
    assert figures(verdict)["range_error_to_rays_m_p99"] < 0.005


def test_flow_explains_pictures_and_pedestrians() -> None:
    verdict = measure_warping(["Stage01"], 0.3)
    assert verdict.ok, verdict.text()
    assert figures(verdict)["error_share_left_on_pedestrians"] < 0.6


@pytest.mark.py38
def test_positions_in_degrees_lead_back_to_the_same_metres() -> None:
    wheel_python("0.9.13")
    verdict = measure_globe(["Stage02"], ["0.9.13", "0.9.16"])
    assert verdict.ok, verdict.text()
    assert figures(verdict)["positions_compared"] == 24


def test_a_busy_machine_ends_an_interrupted_run_and_loses_nothing() -> None:
    verdict = measure_interrupting(trials=2, per_core=1, seed=3, size=SMALL_PICTURE)
    found = figures(verdict)
    assert found["interrupted_runs"] >= 1, verdict.text()
    assert found["recorded_episodes_recorded_again"] == 0, verdict.text()
    assert (found["runs_not_completed"], found["episodes_that_differ"]) == (0, 0), verdict.text()


def test_two_hosts_on_one_folder_commit_each_episode_once() -> None:
    try:
        verdict = measure_two_hosts(schedules=2, seed=4)
    except BadInputError as error:
        pytest.skip(error.message)
    assert verdict.ok, verdict.text()


def test_odd_machines_record_the_same_or_say_why_not() -> None:
    quick = [machine for machine in MACHINES if machine.quick]
    verdict, rows = measure_odd_machines(quick)
    assert verdict.ok, rows
    assert figures(verdict)["not_possible_here"] == 0, rows
