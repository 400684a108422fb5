"""``carstage record`` beside programs of older releases, each with its own client wheel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import carstage
from carstage.runs import record_beside
from client_wheels import wheel_python
from running_simulator import start_simulator, stop_simulator
from ticking_programs import ticking

pytestmark = [pytest.mark.end_to_end, pytest.mark.py38, pytest.mark.xdist_group("following")]

RIG: dict[str, Any] = {
    "image_size": [64, 36],
    "rig": {
        "sensors": [
            {"id": "SEMANTIC", "kind": "semantic", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "IMU", "kind": "imu"},
        ]
    },
    "conversion": {"workers": 1},
}
TICKS = 60


@pytest.mark.parametrize("version", ["0.9.13", "0.9.14", "0.9.15"])
def test_what_a_program_of_an_older_release_ticks_is_recorded(tmp_path: Path, version: str) -> None:
    python, out = wheel_python(version), tmp_path / "out"
    simulator = start_simulator(
        tmp_path / "stderr.log", "--exit-with-parent", "--protocol", version
    )
    try:
        with ticking(simulator, TICKS, python=str(python)) as program:
            ended = record_beside(
                f"{simulator.host}:{simulator.port}", "hero", RIG, out, program.on_event, episodes=1
            )
    finally:
        stop_simulator(simulator)
    assert (ended.state, ended.committed) == ("done", 1)
    (episode,) = carstage.Dataset(out).episodes
    scenario = episode.spec.scenario.to_json()
    assert (scenario["client"], scenario["server"]) == (version, version)
    frames = episode.ledger()["server_frame"].to_pylist()
    assert frames == list(range(frames[0], program.last_frames[0] + 1))
    report = carstage.validate(out)
    assert report.ok, report.problems
    ego = [row for row in episode.objects().to_pylist() if row["is_ego"]]
    assert len(ego) == episode.spec.steps
    assert {tuple(row["semantic_tags"]) for row in ego} == {(14,)}
