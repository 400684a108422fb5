"""Estimates from pilots: sums over the plan, as sure as the pilots are alike."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from carstage.config import Config, parse_config
from carstage.plan import Sampling, ServerFacts, plan_episodes
from carstage.runs.estimating import Prices, estimate_by_pilots, estimate_by_table
from carstage.runs.pilot import Mean, Pilot, record_pilots, shortened, tree_cpu_s

FACTS = ServerFacts(maps={"Stage01": 50})
PILOT = Pilot(
    index=0,
    frames=10,
    begin_cpu_s=4.0,
    begin_wall_s=3.0,
    frames_cpu_s=5.0,
    frames_wall_s=2.0,
    dataset_bytes=1_000_000,
    raw_bytes=20_000_000,
)
SMALL = """
name: small
episodes: 40
duration_s: {choice: [0.5, 20]}
image_size: [96, 54]
vehicles: {count: {range: [1, 4]}}
pedestrians: {count: 1}
conversion: {workers: 1}
server: {self_test: "off"}
campaign: {method: stratified, strata: [duration_s], quotas: [{name: all, frames: 1}]}
"""


def config(text: str = "episodes: 7") -> Config:
    return parse_config(text)


def test_a_sum_is_what_begins_each_episode_and_what_each_frame_takes() -> None:
    plan = plan_episodes(config(), FACTS)  # 7 episodes of 50 frames
    found = estimate_by_pilots(config(), plan, [PILOT], cores=8)
    assert found.core_hours * 3600 == pytest.approx(7 * 4.0 + 350 * 0.5)
    assert found.hours * 3600 == pytest.approx(7 * 3.0 + 350 * 0.2)
    assert found.dataset_bytes == 35_000_000
    assert found.peak_bytes == 35_000_000 + 2 * 50 * 2_000_000
    assert (found.money, found.error) == ({}, {})


def test_a_machine_of_few_cores_is_not_faster_than_they_are() -> None:
    plan = plan_episodes(config(), FACTS)
    found = estimate_by_pilots(config(), plan, [PILOT], cores=1)
    assert found.hours == found.core_hours


def test_workers_share_the_time_and_not_the_work() -> None:
    plan = plan_episodes(config(), FACTS)
    one, four = (
        estimate_by_pilots(config(), plan, [PILOT], workers=workers, cores=2) for workers in (1, 4)
    )
    assert four.hours == pytest.approx(one.hours / 4)
    assert four.core_hours == one.core_hours


def test_money_is_cores_gpus_and_a_month_of_storage() -> None:
    plan = plan_episodes(config(), FACTS)
    prices = Prices(core_hour=0.04, gpu_hour=1.0, gb_month=0.02)
    found = estimate_by_pilots(config(), plan, [PILOT], workers=3, prices=prices, cores=8)
    assert found.money["cores"] == pytest.approx(0.04 * found.core_hours)
    assert found.money["gpus"] == pytest.approx(found.hours * 3)
    assert found.money["storage_month"] == pytest.approx(0.02 * 0.035)
    assert found.money["total"] == pytest.approx(sum(found.money.values()) / 2)


def test_pilots_that_differ_make_it_less_sure() -> None:
    plan = plan_episodes(config(), FACTS)
    alike = estimate_by_pilots(config(), plan, [PILOT, PILOT], cores=8)
    assert set(alike.error.values()) == {0.0}
    other = replace(PILOT, frames_cpu_s=9.0, dataset_bytes=2_000_000)
    differ = estimate_by_pilots(config(), plan, [PILOT, other], cores=8)
    assert differ.error["dataset_bytes"] == pytest.approx(2 / 3)
    assert differ.error["hours"] == 0.0
    assert Mean.of([1.0]).error is None


def test_without_pilots_the_table_is_asked() -> None:
    plan = plan_episodes(config(), FACTS)
    found = estimate_by_table(config(), plan, workers=2)
    assert (found.basis, found.frames, found.error) == ("table", 350, {})
    assert found.hours > 0


def test_a_pilot_is_the_second_of_two_short_episodes() -> None:
    sampling = Sampling(parse_config(SMALL))
    for index, steps in ((0, [5, 5]), (1, [30, 30])):
        plan = plan_episodes(shortened(sampling.config(index)), FACTS)
        assert [spec.steps for spec in plan] == steps
        assert {spec.vehicles.count for spec in plan} == {sampling.config(index).vehicles.count}


def test_pilots_take_turns_with_the_variants(monkeypatch: pytest.MonkeyPatch) -> None:
    recorded: list[tuple[int, str | None, int]] = []

    def record(short: Config, _out: Path, index: int, _notice: object) -> Pilot:
        recorded.append((index, short.weather.choice, len(short.variants)))
        return replace(PILOT, index=index)

    monkeypatch.setattr("carstage.runs.pilot._record", record)
    variants = "{dry: {}, night: {weather: {choice: ClearNight}}}"
    record_pilots(config(f"{{episodes: 6, variants: {variants}}}"), 3)
    assert recorded == [(2, "ClearNoon", 0), (7, "ClearNight", 0), (10, "ClearNoon", 0)]


def test_cpu_time_of_children_counts_while_they_live_and_after() -> None:
    before_s = tree_cpu_s()
    burn = "import time\nwhile time.process_time() < 0.5: pass\nprint('done', flush=True)\ninput()"
    with subprocess.Popen(
        [sys.executable, "-c", burn], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert tree_cpu_s() - before_s >= 0.45
    assert tree_cpu_s() - before_s >= 0.45


@pytest.mark.end_to_end
def test_a_pilot_is_recorded_and_leaves_nothing(
    tmp_path: Path, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    monkeypatch.setenv("XDG_CACHE_HOME", cache)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    said: list[str] = []
    started_s = time.perf_counter()
    (pilot,) = record_pilots(parse_config(SMALL), 1, said.append)
    assert pilot.frames == 5
    assert 0.0 < pilot.begin_wall_s + pilot.frames_wall_s < time.perf_counter() - started_s
    assert pilot.frames_cpu_s > 0.0
    assert pilot.begin_cpu_s > 0.0
    assert pilot.raw_bytes > pilot.dataset_bytes > 0
    assert said[0] == "Pilot 1 of 1: episode 21, shortened."
    assert list(tmp_path.glob("carstage-pilot-*")) == []
