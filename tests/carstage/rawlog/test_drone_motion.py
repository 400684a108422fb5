"""The motion of a drone, which servers do not know, as the log notes it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import analytic_scene
from carstage.rawlog.reader import EpisodeLog

MOTION = {
    "velocity": [3.0, -4.0, 1.0],
    "acceleration": [0.5, 0.0, 0.0],
    "angular_velocity_deg": [0.0, 0.0, 20.0],
}
CARRIER = 50
"""An actor of the analytic scene."""


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log in which an actor carries the sensors of a drone."""
    meta = analytic_scene._world_meta()
    noted = {"drone": {"motion": MOTION}}
    monkeypatch.setattr(analytic_scene, "_world_meta", lambda: {**meta, "agents": noted})
    analytic_scene.write_raw_log(tmp_path / "raw", steps=3)
    path = tmp_path / "raw" / "episode.json"
    document: dict[str, Any] = json.loads(path.read_text())
    document["spec"]["agents"] = [
        {
            "name": "drone",
            "kind": "drone",
            "sensors": document["spec"]["sensors"][:1],
            "seeds": {"looks": 1, "sensor_noise": 2},
            "drone": {
                "path": {"kind": "follow", "x_m": 0.0, "y_m": 0.0, "height_m": 30.0},
                "gimbal": {"pitch_deg": -45.0, "yaw_deg": 0.0},
                "max_speed_m_s": 20.0,
            },
        }
    ]
    ids = {"ego_id": CARRIER, "sensor_actor_ids": {}, "sensor_carrier_ids": {}}
    document["agents"] = {"drone": {**ids, "sensor_attributes": {}}}
    path.write_text(json.dumps(document))
    return tmp_path / "raw"


def test_a_drone_taken_for_the_ego_moves_as_the_log_notes(recorded: Path) -> None:
    for frame in EpisodeLog(recorded, "drone").world_frames(0):
        row = frame.row(CARRIER)
        assert frame.velocity[row].tolist() == MOTION["velocity"]
        assert frame.acceleration[row].tolist() == MOTION["acceleration"]
        assert frame.angular_velocity_deg[row].tolist() == MOTION["angular_velocity_deg"]


def test_everybody_else_moves_as_the_server_says(recorded: Path) -> None:
    whole, seen = EpisodeLog(recorded), EpisodeLog(recorded, "drone")
    for ours, theirs in zip(whole.world_frames(0), seen.world_frames(0), strict=True):
        others = ours.actor_id != CARRIER
        assert np.array_equal(ours.velocity[others], theirs.velocity[others])
        assert not np.array_equal(ours.velocity[~others], theirs.velocity[~others])
