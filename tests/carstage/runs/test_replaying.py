"""A replayed episode moves as the recorded one did, from its first frame on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from carstage.dataset import Dataset, Episode
from driving import carstage

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]

CONFIG = """
name: replaying
duration_s: {duration_s}
fps: {fps}
vehicles: {{count: 6}}
pedestrians: {{count: 3}}
timing: {{warmup_ticks: 40}}
conversion: {{workers: 1}}
server: {{kind: embedded, self_test: off}}
scenario: {scenario}
rig: {{sensors: [{{id: IMU, kind: imu, pose: {{z: 1.0}}}}]}}
"""


def record(
    folder: Path, home: Path, scenario: str, fps: int = 10, duration_s: float = 1.0
) -> Episode:
    folder.mkdir()
    config = folder / "config.yaml"
    config.write_text(CONFIG.format(duration_s=duration_s, fps=fps, scenario=scenario))
    ended = carstage(["run", str(config), "--out", str(folder / "data")], home)
    assert ended.code == 0, ended.stderr
    (episode,) = Dataset(folder / "data").episodes
    return episode


def column(episode: Episode, name: str) -> np.ndarray:
    return np.array(episode.ego()[name].to_pylist(), dtype=np.float64)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    base = tmp_path_factory.mktemp("first")
    return record(base / "first", base, "{kind: autopilot}")


def test_the_ego_moves_and_is_driven_as_recorded(
    first: Episode, tmp_path: Path, home: Path
) -> None:
    again = record(tmp_path / "again", home, f"{{kind: replay, episode: {first.folder}}}")
    speed = column(first, "speed")
    assert speed[0] > 1.0, "an ego that stands shows nothing"
    for name, slack in (("location", 1e-3), ("velocity", 0.01), ("acceleration", 0.1)):
        np.testing.assert_allclose(column(again, name), column(first, name), atol=slack)
    for name in ("throttle", "steer", "brake", "gear", "hand_brake", "reverse"):
        np.testing.assert_allclose(column(again, name), column(first, name), atol=1e-6)
    assert np.ptp(column(first, "throttle")) > 0.01
    # The accelerometer looks three steps back.
    read = [e.sensor("IMU").read(0) for e in (again, first)]
    np.testing.assert_allclose(read[0][:3], read[1][:3], atol=0.3)


def test_everybody_moves_in_the_first_frame(first: Episode, tmp_path: Path, home: Path) -> None:
    again = record(tmp_path / "again", home, f"{{kind: replay, episode: {first.folder}}}")

    def motion(episode: Episode) -> tuple[np.ndarray, np.ndarray]:
        rows = [row for row in episode.objects().to_pylist() if row["k"] == 0]
        rows = [row for row in rows if str(row["track_id"]) in episode.document["actors"]]
        return tuple(np.array([row[n] for row in rows]) for n in ("actor_location", "velocity"))

    places, recorded = motion(first)
    found, replayed = motion(again)
    assert len(places) == len(found) == 10
    assert (np.linalg.norm(recorded, axis=1) > 0.5).sum() > 4
    nearest = np.linalg.norm(places[:, None] - found, axis=-1).argmin(axis=1)
    np.testing.assert_allclose(found[nearest], places, atol=0.01)
    np.testing.assert_allclose(replayed[nearest], recorded, atol=0.01)


def test_twice_the_frame_rate_moves_smoothly(first: Episode, tmp_path: Path, home: Path) -> None:
    scenario = f"{{kind: replay, episode: {first.folder}}}"
    again = record(tmp_path / "again", home, scenario, fps=20, duration_s=0.9)
    own = np.abs(np.diff(column(first, "speed"))).max() * 10.0
    assert np.abs(np.diff(column(again, "speed"))).max() * 20.0 < 2.0 * own + 0.5
