"""What ``carstage record`` makes of a server that dies, a disk that fills, a world that runs."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import carla
import psutil
import pytest

import carstage
from carstage.errors import BadInputError, DiskFullError, ServerError
from carstage.runs import preflight, record_beside
from carstage.runs.events import OtherEvent, RunEvent
from running_simulator import RunningSimulator, start_simulator, stop_simulator
from ticking_programs import ticking

pytestmark = pytest.mark.xdist_group("following")

RIG: dict[str, Any] = {
    "image_size": [64, 36],
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "semantic", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "IMU", "kind": "imu"},
        ]
    },
    "conversion": {"workers": 1},
}


def address(simulator: RunningSimulator) -> str:
    return f"{simulator.host}:{simulator.port}"


def test_a_server_that_dies_leaves_what_it_showed_until_then(tmp_path: Path) -> None:
    own = start_simulator(tmp_path / "stderr.log", "--exit-with-parent")

    def on_event(event: RunEvent) -> None:
        if isinstance(event, OtherEvent) and event.name == "tick" and event.fields["tick"] >= 40:
            own.process.kill()

    out = tmp_path / "out"
    try:
        with (
            ticking(own, 100_000, by_events=False, to_the_end=False),
            pytest.raises(ServerError, match="is gone") as ended,
        ):
            record_beside(address(own), "hero", RIG, out, on_event)
    finally:
        stop_simulator(own)
    assert ended.value.exit_code == 3
    (episode,) = carstage.Dataset(out).episodes
    assert episode.spec.steps > 20
    assert episode.id in str(ended.value)
    # A last frame of which it sent one sensor's data and not the other's is left out.
    report = carstage.validate(out)
    assert report.ok, report.problems
    # Few pixels of a slow car may look the same twice, and a program that ticked long before it was
    # recorded may have driven its car to a wall. Neither is more than a warning.
    assert {one.check for one in report.problems} <= {"repeated", "ego_still"}


def test_a_disk_that_fills_ends_the_recording_and_what_is_committed_stays(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    collectors: list[int] = []

    def on_event(event: RunEvent) -> None:
        program.on_event(event)
        if isinstance(event, OtherEvent) and event.name == "collector_started":
            collectors.append(event.fields["pid"])
        if (
            isinstance(event, OtherEvent)
            and event.name == "ego_found"
            and event.fields["part"] == 1
        ):
            psutil.Process(collectors[0]).rlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    out = tmp_path / "out"
    with (
        ticking(simulator, 30, lives=3, to_the_end=False) as program,
        pytest.raises(DiskFullError, match="raw log") as ended,
    ):
        record_beside(address(simulator), "hero", RIG, out, on_event)
    assert ended.value.exit_code == 3
    (episode,) = carstage.Dataset(out).episodes
    assert episode.spec.scenario.part == 0  # type: ignore[attr-defined]
    assert carstage.validate(out).ok
    assert not list(out.glob("runs/*/raw/*"))


def test_a_disk_without_room_is_refused_before_an_ego_is_waited_for(
    simulator: RunningSimulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = preflight.shutil.disk_usage(tmp_path)
    monkeypatch.setattr(preflight.shutil, "disk_usage", lambda _: usage._replace(free=100_000))
    with pytest.raises(BadInputError, match=r"output: 60 s of recording need about .* free"):
        record_beside(address(simulator), "nobody", RIG, tmp_path / "out", wait_s=600.0)
    assert not (tmp_path / "out").exists()


def test_a_world_that_runs_on_its_own_is_refused_in_words(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    client = carla.Client(simulator.host, simulator.port)
    client.set_timeout(120.0)
    world = client.load_world("Stage01")
    blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
    blueprint.set_attribute("role_name", "hero")
    ego = world.spawn_actor(blueprint, world.get_map().get_spawn_points()[0])
    try:
        with pytest.raises(BadInputError, match="not in synchronous mode with a fixed step"):
            record_beside(address(simulator), "hero", RIG, tmp_path / "out")
    finally:
        ego.destroy()
