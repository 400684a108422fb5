"""The collector under Python 3.8 with the old client wheels, against the dialect of each."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import carstage
from carstage.rawlog.reader import EpisodeLog
from carstage.server import free_port
from client_wheels import wheel_python
from running_simulator import start_simulator, stop_simulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.py38, pytest.mark.xdist_group("collector")]

PlanMaker = Callable[..., dict[str, Any]]
END_S = 90.0
STEPS = 10


def record(version: str, plan: dict[str, Any], folder: Path) -> list[dict[str, Any]]:
    """Run the collector in the wheel's interpreter and return its events."""
    python = wheel_python(version)
    plan_path = folder / "plan.json"
    simulator = start_simulator(folder / "server.log", "--exit-with-parent", "--protocol", version)
    plan["server"].update(port=simulator.port, traffic_manager_port=free_port())
    plan_path.write_text(json.dumps(plan))
    try:
        done = subprocess.run(
            [python, "-W", "error", "-m", "carstage.collector", plan_path],
            env={
                "PATH": os.environ["PATH"],
                "HOME": str(folder),
                "PYTHONPATH": str(Path(carstage.__file__).parents[1]),
            },
            capture_output=True,
            text=True,
            timeout=END_S,
            check=False,
        )
    finally:
        stop_simulator(simulator)
    log = (folder / "server.log").read_text()
    assert done.returncode == 0, f"{done.stderr[-4000:]}\n{log[-4000:]}"
    assert log == ""
    return [json.loads(line) for line in done.stdout.splitlines()]


def check(version: str, make_plan: PlanMaker, tmp_path: Path, car_tag: int) -> None:
    """An episode of ten ticks with every frame of every sensor."""
    folder = tmp_path / "raw"
    plan = make_plan(folder, steps=STEPS, dialect=version)
    events = record(version, plan, tmp_path)
    started, connected = events[:2]
    assert (started["client_version"], started["python"].rpartition(".")[0]) == (version, "3.8")
    assert connected["server_version"] == version
    assert events[-2]["event"] == "episode_recorded"
    assert events[-2]["incomplete"] == 0
    log = EpisodeLog(folder)
    assert log.is_complete()
    assert log.header["spawned"] == {"vehicles": 8, "pedestrians": 4}
    rows = log.ledger()
    first = log.header["first_frame"]
    assert [row["frame"] for row in rows] == list(range(first, first + STEPS))
    for row in rows:
        assert {outcome["state"] for outcome in row["sensors"].values()} == {"ok"}
    assert log.actors()[log.header["ego_id"]].semantic_tags == (car_tag,)
    pictures = log.read_segment("SEMANTIC", 0)
    assert car_tag in bytes(pictures[-1].payload)[2::4]


def test_collector_records_with_wheel_0_9_13(make_plan: PlanMaker, tmp_path: Path) -> None:
    check("0.9.13", make_plan, tmp_path, car_tag=10)


def test_collector_records_with_wheel_0_9_14(make_plan: PlanMaker, tmp_path: Path) -> None:
    check("0.9.14", make_plan, tmp_path, car_tag=14)
