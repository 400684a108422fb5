"""The collector under Python 3.8 with the oldest client wheel, warnings being errors.

Whole runs with every wheel are in tests/carstage/runs/test_run_wheels.py.
"""

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
OLD_VEHICLE = 10
"""The raw log holds the server's own numbers."""


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


def test_collector_records_with_wheel_0_9_13_without_a_warning(
    make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    plan = make_plan(folder, steps=STEPS, dialect="0.9.13")
    events = record("0.9.13", plan, tmp_path)
    started, connected = events[:2]
    assert (started["client_version"], started["python"].rpartition(".")[0]) == ("0.9.13", "3.8")
    assert connected["server_version"] == "0.9.13"
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
    assert log.actors()[log.header["ego_id"]].semantic_tags == (OLD_VEHICLE,)
    pictures = log.read_segment("SEMANTIC", 0)
    assert OLD_VEHICLE in bytes(pictures[-1].payload)[2::4]
