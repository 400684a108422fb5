"""A self-test of the embedded simulator, recorded once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from carstage.selftest.evidence import Evidence, read_evidence
from carstage.selftest.scene_setup import plan_self_test
from carstage.server import free_port
from carstage.server.asking import ask_server, ask_spawn_points
from running_simulator import RunningSimulator

END_S = 120.0


@pytest.fixture(scope="session")
def recorded(simulator: RunningSimulator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the raw log."""
    folder = tmp_path_factory.mktemp("selftest")
    facts = ask_server("127.0.0.1", simulator.port, "0.9.16")
    name, spawn_points = ask_spawn_points("127.0.0.1", simulator.port)
    spec = plan_self_test(facts.dialect, name, spawn_points, facts.blueprints)
    plan = {
        "plan_version": 1,
        "server": {
            "host": "127.0.0.1",
            "port": simulator.port,
            "traffic_manager_port": free_port(),
        },
        "sensor_warmup_ticks": 2,
        "episodes": [
            {
                "episode_id": "selftest",
                "attempt": "a1",
                "folder": str(folder / "raw"),
                "spec": spec.to_json(),
            }
        ],
    }
    (folder / "plan.json").write_text(json.dumps(plan))
    done = subprocess.run(
        [sys.executable, "-m", "carstage.collector", str(folder / "plan.json")],
        env={**os.environ, "HOME": str(folder)},
        capture_output=True,
        timeout=END_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return folder / "raw"


@pytest.fixture(scope="session")
def evidence(recorded: Path) -> Evidence:
    """What was recorded, as arrays."""
    return read_evidence(recorded)
