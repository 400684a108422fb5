"""Runs beside each other: what each took, and which settings differ."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.config import dump_config, load_demo
from carstage.runs.comparing import differing_settings, run_figures
from sites import FakeRun

BEGUN_S = 1_700_000_000.0


@pytest.fixture
def ended(tmp_path: Path) -> FakeRun:
    run = FakeRun(tmp_path / "drives", "20260101-000000-abcdef", {"name": "a drive"})
    run.end()
    run.say(state="done", pid_started=BEGUN_S, heartbeat=BEGUN_S + 20)
    return run


def load(run: FakeRun, after_s: float, cores: float, memory_bytes: int, **more: object) -> None:
    taken = {"cpu_cores": cores, "memory_bytes": memory_bytes, "written_bytes_s": 100}
    run.event("load", **{**taken, "time": BEGUN_S + after_s, "disk_free_bytes": 1, **more})


def test_figures_are_means_and_sums_over_the_run(ended: FakeRun) -> None:
    load(ended, 10, 1.0, 500)
    load(ended, 12, 7.0, 900)
    load(ended, 20, 1.0, 400)
    ended.event("frames_converted", episode_id="e1", frames=30)
    ended.event("frames_converted", episode_id="e2", frames=10)
    figures = run_figures(ended.folder)
    assert (figures.name, figures.state, figures.took_s) == ("a drive", "done", 20)
    assert (figures.frames, figures.frames_s) == (40, 2.0)
    assert figures.cpu_cores == pytest.approx((10 * 1 + 2 * 7 + 8 * 1) / 20)
    assert (figures.memory_bytes, figures.written_bytes) == (900, 2000)


def test_what_single_workers_take_counts_once(ended: FakeRun) -> None:
    load(ended, 2, 3.0, 500)
    load(ended, 2, 2.0, 400, worker=1)
    load(ended, 2, 1.0, 100, worker=2)
    for worker in (1, 2):
        ended.event("frames_converted", episode_id=f"e{worker}", frames=30, worker=worker)
    figures = run_figures(ended.folder)
    assert (figures.cpu_cores, figures.memory_bytes) == (3.0, 500)
    assert figures.frames == 60


def test_a_run_without_measurements_has_none_and_lines_of_other_versions_are_left_out(
    ended: FakeRun,
) -> None:
    ended.event("load", cpu="much")
    figures = run_figures(ended.folder)
    assert (figures.cpu_cores, figures.memory_bytes, figures.written_bytes) == (None, None, None)
    assert figures.frames == 0
    (ended.folder / "events.jsonl").unlink()
    assert run_figures(ended.folder).frames == 0


def test_a_killed_run_is_dead(ended: FakeRun) -> None:
    ended.say(state="recording")
    assert run_figures(ended.folder).state == "dead"


def test_only_settings_that_differ_are_named_with_their_values() -> None:
    usual = dump_config(load_demo(["name=one"]))
    other = dump_config(
        load_demo(
            ["name=two", "vehicles.count=3", "rig.sensors[CAM_LEFT].attributes.fov_deg=60",
             "ego.spawn=5"]
        )
    )  # fmt: skip
    assert differing_settings([usual, usual]) == []
    found = {one.path: one.values for one in differing_settings([usual, other])}
    assert found == {
        "vehicles.count": (usual["vehicles"]["count"], 3),
        "ego.spawn": (usual["ego"]["spawn"], 5),
        "rig.sensors[CAM_LEFT].attributes.fov_deg": (90.0, 60.0),
    }


def test_a_sensor_that_one_run_lacks_is_one_difference_wherever_it_stands() -> None:
    config = dump_config(load_demo())
    sensors = config["rig"]["sensors"]
    fewer = {**config, "rig": {**config["rig"], "sensors": list(reversed(sensors[1:]))}}
    (found,) = differing_settings([config, fewer, config])
    assert found.path == f"rig.sensors[{sensors[0]['id']}]"
    assert found.values == (sensors[0], None, sensors[0])
