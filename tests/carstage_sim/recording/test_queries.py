"""What clients print about a log."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from carstage_sim.maps import Town
from carstage_sim.recording import RecorderController, RecordingError, RecordingsFolder
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.pose import Pose, compose
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
DELTA_S = 0.05


@pytest.fixture(scope="module")
def crash(
    stage01: Town, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[RecorderController, dict[str, int]]]:
    """Eight seconds: the hero runs into a standing car, and a third one never moves."""
    recorder = RecorderController(RecordingsFolder(tmp_path_factory.mktemp("logs")))
    world = World(stage01, episode_id=1)
    x, y, z, pitch, yaw, roll = stage01.spawn_points[0].tolist()
    start = Pose((x, y, z), (pitch, yaw, roll))
    ids = {
        "target": world.spawn(CAR, {}, compose(start, Pose((12.0, 0.0, 0.0)))).actor_id,
        "hero": world.spawn(CAR, {"role_name": "hero"}, start).actor_id,
    }
    world.control_vehicle(ids["hero"], VehicleControl(throttle=0.8))
    world.control_vehicle(ids["target"], VehicleControl(hand_brake=True))
    recorder.start("crash.log", world, additional_data=True)
    for tick in range(160):
        if tick == 100:
            world.destroy(ids["target"])
        recorder.after_tick(world.tick(DELTA_S, 5))
    recorder.stop()
    yield recorder, ids
    recorder.end_episode()


def test_file_info_tells_head_actors_events_and_length(
    crash: tuple[RecorderController, dict[str, int]],
) -> None:
    recorder, ids = crash
    text = recorder.file_info("crash.log", show_all=False)
    assert text.startswith("Version: 1\nMap: Carla/Maps/Stage01\nDate: ")
    assert re.search(r"^Date: \d\d/\d\d/\d\d \d\d:\d\d:\d\d$", text, re.M)
    assert "Frame 1 at 0 seconds\n" in text
    assert re.search(rf"^ Create {ids['hero']}: {CAR} \(1\) at \(-?[\d.e+]+, ", text, re.M)
    assert "  role_name = hero\n" in text
    assert f"Frame 101 at 5 seconds\n Destroy {ids['target']}\n" in text
    assert re.search(rf"^ Collision id \d+ between {ids['hero']} \(hero\)  with ", text, re.M)
    assert "Positions" not in text
    assert text.endswith("\nFrames: 160\nDuration: 7.95 seconds\n")


def test_file_info_of_everything_tells_each_kind_of_record(
    crash: tuple[RecorderController, dict[str, int]],
) -> None:
    recorder, _ = crash
    text = recorder.file_info("crash.log", show_all=True)
    for title in (
        "Positions", "State traffic lights", "Vehicle animations", "Walker animations",
        "Vehicle light animations", "Dynamic actors", "Actor bounding boxes",
        "Actor trigger volumes", "Physics Control events", "Traffic Light time events",
    ):  # fmt: skip
        assert re.search(rf"^ {title}: \d+$", text, re.M), title
    assert " Current platform time: 7.95\n" in text
    assert "   mass = " in text


def test_collisions_are_listed_once_with_types_and_filtered_by_category(
    crash: tuple[RecorderController, dict[str, int]],
) -> None:
    recorder, ids = crash
    for first, second in (("v", "v"), ("h", "a"), ("a", "a"), ("h", "v")):
        lines = recorder.collisions("crash.log", first, second).splitlines()
        assert lines[4].split() == ["Time", "Types", "Id", "Actor", "1", "Id", "Actor", "2"]
        rows = [line.split() for line in lines[5:-3]]
        assert next(row[1:] for row in rows) == [
            "v", "v", str(ids["hero"]), CAR, str(ids["target"]), CAR
        ]  # fmt: skip
        assert len(rows) < 5  # touching goes on for many frames
    nobody = recorder.collisions("crash.log", "w", "a").splitlines()
    assert nobody[5:] == ["", "Frames: 160", "Duration: 7.95 seconds"]


def test_blocked_actors_are_listed_by_how_long_they_stood(
    crash: tuple[RecorderController, dict[str, int]],
) -> None:
    recorder, ids = crash
    lines = recorder.actors_blocked("crash.log", 2.0, 1000.0).splitlines()
    assert lines[4].split() == ["Time", "Id", "Actor", "Duration"]
    rows = [line.split() for line in lines[5:-3]]
    lasted = [float(row[-1]) for row in rows]
    assert lasted == sorted(lasted, reverse=True)
    assert str(ids["target"]) in [row[1] for row in rows]
    assert recorder.actors_blocked("crash.log", 60.0, 100.0).splitlines()[5:-3] == []


def test_other_files_are_not_overwritten(stage01: Town, tmp_path: Path) -> None:
    recorder, world = RecorderController(RecordingsFolder(tmp_path)), World(stage01, episode_id=1)
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(RecordingError, match="not overwritten"):
        recorder.start("thesis.txt", world, additional_data=False)
    assert (tmp_path / "thesis.txt").read_text() == "precious"
    nowhere = RecorderController(RecordingsFolder(Path("/proc/nowhere")))
    with pytest.raises(RecordingError, match="cannot write"):
        nowhere.start("a.log", world, additional_data=False)
