"""Speed and load of a run, as its events tell them."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from carstage.web.runs.follower import RunFollower, Series


def write(folder: Path, *events: dict[str, Any]) -> RunFollower:
    text = "".join(json.dumps(event) + "\n" for event in events)
    (folder / "events.jsonl").write_text(text)
    follower = RunFollower(folder)
    follower.read()
    return follower


def tick(time_s: float, number: int, **more: Any) -> dict[str, Any]:
    return {"time": time_s, "event": "tick", "episode_id": "e", "tick": number, **more}


def test_several_workers_are_told_apart(tmp_path: Path) -> None:
    lines = []
    for second in range(5):
        lines += [tick(100.0 + second, 10 * second, k=10 * second, worker=1)]
        lines += [tick(100.5 + second, 4 * second, k=2 * second, worker=2)]
    follower = write(tmp_path, *lines)
    told = follower.ticks.after(0)
    steps = {worker: {p.tick_s for p in told if p.worker == worker} for worker in (1, 2)}
    assert steps == {1: {None, 0.1}, 2: {None, 0.25}}
    frames = {worker: {p.frames_s for p in told if p.worker == worker} for worker in (1, 2)}
    assert frames == {1: {None, 10.0}, 2: {None, 2.0}}
    assert follower.rate_ticks_s() == pytest.approx(14.0)


def test_the_next_episode_begins_anew(tmp_path: Path) -> None:
    follower = write(tmp_path, tick(1.0, 8, k=8), tick(2.0, 9, k=9), tick(50.0, 0, k=0))
    assert [p.tick_s for p in follower.ticks.after(0)] == [None, 1.0, None]
    assert [p.frames_s for p in follower.ticks.after(0)] == [None, 1.0, None]
    assert follower.rate_ticks_s() is None


def test_loads_are_read_and_those_of_another_version_left_out(tmp_path: Path) -> None:
    load = {"event": "load", "cpu_cores": 2.0, "memory_bytes": 5, "written_bytes_s": None}
    good = {**load, "disk_free_bytes": 7, "time": 3.0, "worker": 2}
    follower = write(tmp_path, {**load, "time": 2.0}, good)
    (point,) = follower.loads.after(0)
    assert (point.worker, point.cpu_cores, point.disk_free_bytes) == (2, 2.0, 7)
    assert follower.loads.after(1) == []


def test_a_long_series_keeps_its_begin_and_its_newest() -> None:
    series: Series[int] = Series()
    for number in range(20_000):
        series.append(number)
    kept = series.after(0)
    assert len(kept) <= 3000
    assert kept[0] == 0
    assert kept[-1] >= 19_990
    assert series.after(series.seen) == []
    told = 0
    while not series.after(20_000):
        series.append(20_000 + told)
        told += 1
    assert told < 60


def test_a_long_series_is_thinned_evenly_and_keeps_its_workers_apart() -> None:
    series: Series[int] = Series()
    for number in range(50_000):
        series.append(number)
    kept = series.after(0)
    gaps = [later - earlier for earlier, later in pairwise(kept)]
    assert max(gaps) <= 3 * min(gaps)
    of_a_worker = [number for number in kept if number % 2 == 0]
    assert len(of_a_worker) == pytest.approx(len(kept) / 2, rel=0.05)
