"""The ego has a driver of its own: its commands are recorded, and drive again to the byte."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import carla
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import carstage
from carstage.dataset import Episode
from carstage.errors import ConfigError
from carstage.runs import RunResult
from running_simulator import RunningSimulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("following")]

EXAMPLES = Path(__file__).parents[3] / "examples"
STEPS, EVERY = 20, 2
WAVES = {
    "kind": "class",
    "name": "own_driver:Waves",
    "folders": [str(EXAMPLES)],
    "parameters": {"speed_m_s": 5.0, "swing_m": 0.8, "period_s": 1.5},
}
SCENE: dict[str, Any] = {
    "seed": 11,
    "map": {"choice": "Stage01"},
    "vehicles": {"count": 3},
    "pedestrians": {"count": 1},
    "fps": 10,
    "duration_s": STEPS / 10,
    "save_every": EVERY,
    "timing": {"warmup_ticks": 5},
    "image_size": [48, 27],
    "conversion": {"workers": 1},
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}},
            {
                "id": "LIDAR",
                "kind": "lidar",
                "pose": {"z": 2.2},
                "attributes": {"channels": 8, "points_per_second": 10000, "noise_stddev": 0.02},
            },
            {"id": "IMU", "kind": "imu", "attributes": {"noise_accel_stddev_x": 0.1}},
        ]
    },
}
FAILING = """
from carstage.collector.drivers import Driver
import carla

class Failing(Driver):
    sensors = ("CAM",)

    def start(self, observation):
        self.frames = []

    def drive(self, observation):
        self.frames.append(observation.data["CAM"].frame - observation.frame)
        if observation.tick == 7:
            raise LookupError("frames behind: %s" % set(self.frames))
        return carla.VehicleControl()
"""


AT_THE_KEYS = '''
import pygame
from carstage.collector.drivers import Driver
from carstage.collector.drivers.devices import device_driver
from carstage.spec import DeviceDriverSpec

class AtTheKeys(Driver):
    """Somebody at the keyboard: full throttle from step 2 on, to the right from step 8 on."""

    KEYS = {2: pygame.K_w, 8: pygame.K_d}

    def __init__(self):
        self.window = device_driver(DeviceDriverSpec("keyboard", "CAM"), 0.1)
        self.sensors = self.window.sensors
        self.start, self.stop = self.window.start, self.window.stop

    def drive(self, observation):
        if observation.tick in self.KEYS:
            key = self.KEYS[observation.tick]
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))
        return self.window.drive(observation)
'''


def record(
    simulator: RunningSimulator, folder: Path, driver: Any, seed: int = 11, **changes: Any
) -> RunResult:
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port, "self_test": "off"}
    ego = {"spawn": 3, "driver": driver}
    return carstage.run({**SCENE, "seed": seed, "ego": ego, "server": at, **changes}, folder)


def only(folder: Path) -> Episode:
    (episode,) = carstage.Dataset(folder).episodes
    return episode


@pytest.fixture(scope="module")
def driven(simulator: RunningSimulator, tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("driven")
    result = record(simulator, folder, WAVES)
    assert result.state == "done", result.failures
    return only(folder)


def tables(episode: Episode) -> dict[str, pa.Table]:
    """All tables, but for the id of the episode."""
    found = {}
    for path in sorted(episode.folder.glob("*.parquet")):
        table = pq.read_table(path)
        own = [name for name in table.column_names if name in ("episode_id", "instance_uid")]
        found[path.name] = table.drop_columns(own)
    return found


def test_each_command_is_recorded_with_its_frame(driven: Episode) -> None:
    controls = driven.controls()
    assert controls is not None
    rows = controls.to_pylist()
    assert [row["tick"] for row in rows] == list(range(STEPS))
    assert [row["k"] for row in rows] == [
        None if tick % EVERY else tick // EVERY for tick in range(STEPS)
    ]
    assert controls["server_frame"].to_pylist() == driven.ledger()["server_frame"].to_pylist()
    # What the server says that it applied in the very frames.
    for row, ego in zip(rows[::EVERY], driven.ego().to_pylist(), strict=True):
        for name in ("throttle", "steer", "brake", "hand_brake", "reverse"):
            assert ego[name] == row[name]
    steer = np.array(controls["steer"].to_pylist())
    assert steer.min() < -0.05
    assert steer.max() > 0.05
    assert driven.ego()["speed"].to_pylist()[-1] > 2.0
    assert carstage.validate(driven.folder.parents[2]).ok


def test_a_replay_has_the_same_bytes(
    simulator: RunningSimulator, driven: Episode, tmp_path: Path
) -> None:
    # Seed, traffic and start come from the episode.
    replay = {"kind": "replay", "episode": str(driven.folder)}
    result = record(simulator, tmp_path, replay, seed=99, vehicles={"count": 0})
    assert result.state == "done", result.failures
    again = only(tmp_path)
    assert again.id != driven.id
    first, second = (
        {p.name: p.read_bytes() for p in e.folder.glob("sensors/**/*") if p.is_file()}
        for e in (driven, again)
    )
    assert len(first) == 2 * STEPS // EVERY + 1
    assert first == second
    one, other = tables(driven), tables(again)
    assert one.keys() == other.keys()
    for name, table in one.items():
        assert table.equals(other[name]), name


def test_a_replay_needs_an_episode_that_was_driven(
    simulator: RunningSimulator, driven: Episode, tmp_path: Path
) -> None:
    replay = {"kind": "replay", "episode": str(driven.folder)}
    with pytest.raises(ConfigError, match=r"^fps: the episode in ego.driver was driven at 10 Hz"):
        record(simulator, tmp_path, replay, fps=20)
    with pytest.raises(ConfigError, match=r"^duration_s: the episode in ego.driver .* for 2 s"):
        record(simulator, tmp_path, replay, duration_s=2.5)


def test_a_driver_that_raises_ends_the_episode_and_says_where(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    (tmp_path / "failing_driver.py").write_text(FAILING)
    driver = {"kind": "class", "name": "failing_driver:Failing", "folders": [str(tmp_path)]}
    result = record(simulator, tmp_path / "out", driver)
    assert result.state == "failed"
    ((_, message),) = result.failures.items()
    assert "failing_driver:Failing raised LookupError: frames behind: {0}" in message
    assert "ahead of step 7 (frame " in message
    assert "failing_driver.py, line 14, drive" in message
    log = (result.folder / "logs" / "collector.log").read_text()
    assert "Traceback" in log
    events = (result.folder / "events.jsonl").read_text()
    assert events.count('"episode_started"') == 1, "another try would end alike"
    assert not carstage.Dataset(tmp_path / "out").episodes


def test_keys_drive_and_are_recorded(
    simulator: RunningSimulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pygame", reason="the extra drive is not installed")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    (tmp_path / "at_the_keys.py").write_text(AT_THE_KEYS)
    driver = {"kind": "class", "name": "at_the_keys:AtTheKeys", "folders": [str(tmp_path)]}
    result = record(simulator, tmp_path / "out", driver, duration_s=1.2)
    assert result.state == "done", result.failures
    controls = only(tmp_path / "out").controls()
    assert controls is not None
    throttle, steer = (controls[name].to_pylist() for name in ("throttle", "steer"))
    assert throttle[:2] == [0.0, 0.0]
    assert throttle[2] == pytest.approx(0.1)
    assert throttle[11] == 1.0
    assert not any(steer[:8])
    assert steer[-1] == pytest.approx(0.2)
    assert only(tmp_path / "out").ego()["speed"].to_pylist()[-1] > 0.5


def test_the_route_controller_keeps_to_its_lane(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    result = record(
        simulator,
        tmp_path,
        {"kind": "route", "speed_m_s": 7.0},
        duration_s=4.0,
        scenario={"kind": "route", "through": [12]},
        rig={"sensors": [{"id": "IMU", "kind": "imu"}]},
    )
    assert result.state == "done", result.failures
    ego = only(tmp_path).ego()
    assert 2.0 < max(ego["speed"].to_pylist()) < 8.0
    client = carla.Client(simulator.host, simulator.port)
    client.set_timeout(30.0)
    world_map = client.get_world().get_map()
    places = [carla.Location(*xyz) for xyz in ego["location"].to_pylist()]
    lanes = [world_map.get_waypoint(place).transform.location for place in places]
    assert places[0].distance(places[-1]) > 8.0
    aside_m = [math.hypot(a.x - b.x, a.y - b.y) for a, b in zip(places, lanes, strict=True)]
    assert max(aside_m) < 0.8
