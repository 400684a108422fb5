"""A log of CARLA's recorder is played as it was recorded, with any rig."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import recorder_program
from carstage.config import check_config
from carstage.config.scene import LogScenario
from carstage.dataset import Dataset, Episode
from carstage.dataset.recorder_log import read_log
from carstage.errors import ConfigError
from driving import carstage
from running_simulator import start_simulator, stop_simulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]

TICKS = 60
CONFIG = """
name: playing
duration_s: {duration_s}
fps: {fps}
timing: {{warmup_ticks: 5}}
conversion: {{workers: 1}}
server: {{kind: embedded, self_test: off}}
scenario: {{kind: log, file: {log}, start_s: {start_s}}}
rig: {{sensors: [{{id: IMU, kind: imu, pose: {{z: 1.0}}}}]}}
"""


@dataclass(frozen=True)
class Logged:
    """A log, and by tick who was where when it was written."""

    path: Path
    ego: int
    seen: list[dict[int, list[float]]]


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Logged:
    folder = tmp_path_factory.mktemp("log")
    simulator = start_simulator(folder / "simulator.log")
    try:
        program = [sys.executable, recorder_program.__file__, simulator.host, str(simulator.port)]
        ended = subprocess.run(
            [*program, "drive.log", str(TICKS)], capture_output=True, text=True, check=False
        )
    finally:
        stop_simulator(simulator)
    assert ended.stdout, ended.stderr
    told = json.loads(ended.stdout.splitlines()[-1])
    seen = [{int(one): pose for one, pose in poses.items()} for poses in told["seen"]]
    return Logged(folder / "recordings" / "drive.log", told["ego"], seen)


def play(logged: Logged, folder: Path, home: Path, **settings: float) -> Episode:
    folder.mkdir()
    config = folder / "config.yaml"
    given = {"duration_s": 2.0, "fps": 20, "start_s": 0.0, **settings}
    config.write_text(CONFIG.format(log=logged.path, **given))
    ended = carstage(["run", str(config), "--out", str(folder / "data")], home)
    assert ended.code == 0, ended.stderr
    (episode,) = Dataset(folder / "data").episodes
    return episode


def places(episode: Episode, k: int) -> np.ndarray:
    """``(N, 3)`` of everybody in a frame, ordered by place."""
    rows = [row for row in episode.objects().to_pylist() if row["k"] == k]
    rows = [row for row in rows if str(row["track_id"]) in episode.document["actors"]]
    found = np.array([row["actor_location"] for row in rows])
    return found[np.lexsort(found.T)]


def recorded_places(logged: Logged, tick: int) -> np.ndarray:
    found = np.array([pose[:3] for pose in logged.seen[tick].values()])
    return found[np.lexsort(found.T)]


@pytest.mark.parametrize(("start_s", "first"), [(0.0, 0), (0.5, 10)])
def test_everybody_is_where_they_were(
    logged: Logged, tmp_path: Path, home: Path, start_s: float, first: int
) -> None:
    episode = play(logged, tmp_path / "run", home, start_s=start_s)
    ego = np.array(episode.ego()["location"].to_pylist())
    moved = np.linalg.norm(np.diff(ego, axis=0), axis=1)
    assert moved.min() > 0.01, "an ego that stands shows nothing"
    for k in (0, 7, 39):
        wanted = recorded_places(logged, first + k)
        np.testing.assert_allclose(places(episode, k), wanted, atol=0.01)
        recorded = logged.seen[first + k][logged.ego]
        np.testing.assert_allclose(ego[k, :2], recorded[:2], atol=0.01)


def test_speeds_are_those_of_the_first_frame_on(logged: Logged, tmp_path: Path, home: Path) -> None:
    episode = play(logged, tmp_path / "run", home)
    velocity = np.array(episode.ego()["velocity"].to_pylist())
    poses = np.array([poses[logged.ego][:3] for poses in logged.seen])
    wanted = np.gradient(poses, recorder_program.STEP_S, axis=0)[: len(velocity)]
    np.testing.assert_allclose(velocity[:, :2], wanted[:, :2], atol=0.15)


def test_the_same_log_is_the_same_episode_and_another_is_not(
    logged: Logged, tmp_path: Path
) -> None:
    scenario = LogScenario(kind="log", file=str(logged.path))
    first = read_log(scenario).episode_id
    copy = tmp_path / "copy.log"
    content = bytearray(logged.path.read_bytes())
    copy.write_bytes(content)
    assert read_log(LogScenario(kind="log", file="copy.log"), tmp_path).episode_id == first
    content[-60] ^= 1
    copy.write_bytes(content)
    assert read_log(LogScenario(kind="log", file=str(copy))).episode_id != first


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"ego": "nobody"}, r"scenario\.ego: no vehicle 'nobody' is in the log, which has 4"),
        ({"start_s": 60.0}, r"scenario\.start_s: the log ends after"),
        ({"file": "/etc/hostname"}, r"scenario\.file: /etc/hostname is no log"),
        ({"file": "/dev/zero"}, r"scenario\.file: /dev/zero cannot be read"),
        ({"file": "missing.log"}, r"scenario\.file: .*missing\.log cannot be read"),
    ],
)
def test_what_cannot_be_played_is_refused_with_the_setting(
    logged: Logged, settings: dict[str, object], message: str
) -> None:
    document = {"kind": "log", "file": str(logged.path), **settings}
    config = check_config({"scenario": document})
    assert isinstance(config.scenario, LogScenario)
    with pytest.raises(ConfigError, match=message):
        read_log(config.scenario)


def test_a_log_that_ends_or_is_spoilt_anywhere_is_read_or_refused(
    logged: Logged, tmp_path: Path
) -> None:
    content, path = logged.path.read_bytes(), tmp_path / "spoilt.log"
    rng, outcomes = np.random.default_rng(3), set()
    for number in range(300):
        spoilt = bytearray(content[: rng.integers(1, len(content))] if number % 2 else content)
        for at in rng.integers(0, min(len(spoilt), 4000), 4 * (number % 3)):
            spoilt[at] = rng.integers(0, 256)
        path.write_bytes(spoilt)
        try:
            read_log(LogScenario(kind="log", file=str(path)))
            outcomes.add("read")
        except ConfigError:
            outcomes.add("refused")
    assert outcomes == {"read", "refused"}
