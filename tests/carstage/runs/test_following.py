"""``carstage record`` beside a program that ticks, with the real client on both sides."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import carstage
from carstage.config import check_config
from carstage.errors import BadInputError, ConfigError, ConversionError, ServerError
from carstage.runs import RunResult, record_beside
from carstage.runs.attempt_commit import AttemptCommit
from carstage.runs.events import RunEvent
from carstage.runs.rig_source import config_of, settings_of
from carstage.server import free_port
from running_simulator import RunningSimulator
from ticking_programs import ticking
from waiting import await_that

pytestmark = pytest.mark.xdist_group("following")

RIG: dict[str, Any] = {
    "image_size": [64, 36],
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "IMU", "kind": "imu", "pose": {"z": 0.5}},
        ]
    },
}
FAST_RIG: dict[str, Any] = {"rig": {"sensors": [{"id": "IMU", "kind": "imu"}]}}
BOARD = [{"target": "billboard", "pattern": "noise"}]


def address(simulator: RunningSimulator) -> str:
    return f"{simulator.host}:{simulator.port}"


def test_each_life_of_the_ego_becomes_a_valid_episode(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with ticking(simulator, 150, lives=2) as program:
        ended = record_beside(address(simulator), "hero", RIG, out, program.on_event, episodes=2)
    assert (ended.state, ended.committed, ended.exit_code) == ("done", 2, 0)
    report = carstage.validate(out)
    assert report.ok, report.problems
    specs = [episode.spec for episode in carstage.Dataset(out).episodes]
    assert sorted(spec.scenario.part for spec in specs) == [0, 1]  # type: ignore[attr-defined]
    for spec in specs:
        document = spec.to_json()
        assert document["scenario"]["reproducible"] is False
        assert document["scenario"]["role"] == "hero"
        assert document["map"] == "Stage01"
        assert spec.fps == 10.0
        assert spec.steps >= 10  # all but those in which the streams came up
    ledgers = [
        episode.ledger()["server_frame"].to_pylist() for episode in carstage.Dataset(out).episodes
    ]
    assert sorted(frames[-1] for frames in ledgers) == program.last_frames


def test_a_program_at_full_speed_loses_no_frame(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with ticking(simulator, 300) as program:
        record_beside(address(simulator), "hero", FAST_RIG, out, program.on_event, episodes=1)
    (ledger,) = (pq.read_table(path) for path in out.glob("episodes/*/*/frames.parquet"))
    frames = ledger["server_frame"].to_pylist()
    assert frames == list(range(frames[0], frames[0] + len(frames)))
    assert [frames[-1]] == program.last_frames
    assert len(frames) >= 200
    assert carstage.validate(out).ok


RUNS_FREELY_AT_ITS_END = """
import sys, carla
client = carla.Client(sys.argv[1], int(sys.argv[2]))
client.set_timeout(60.0)
world = client.load_world("Stage01")
settings = world.get_settings()
settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
world.apply_settings(settings)
blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
blueprint.set_attribute("role_name", "hero")
ego = world.spawn_actor(blueprint, world.get_map().get_spawn_points()[0])
while not len(world.get_actors().filter("sensor.*")):
    world.tick()
for _ in range(60):
    frame = world.tick()
settings.synchronous_mode, settings.fixed_delta_seconds = False, None
world.apply_settings(settings)
for _ in range(20):
    world.wait_for_tick()
ego.destroy()
print(frame)
"""


def test_a_program_that_lets_the_world_run_freely_ends_its_episode_there(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    """As most of CARLA's programs do before they destroy their ego."""
    out = tmp_path / "out"
    command = [sys.executable, "-c", RUNS_FREELY_AT_ITS_END, simulator.host, str(simulator.port)]
    program = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        ended = record_beside(address(simulator), "hero", FAST_RIG, out, episodes=1)
        told, _ = program.communicate(timeout=120.0)
    finally:
        program.kill()
        program.communicate()
    assert (ended.state, ended.committed) == ("done", 1)
    (episode,) = carstage.Dataset(out).episodes
    assert episode.ledger()["server_frame"].to_pylist()[-1] == int(told)
    assert carstage.validate(out).ok


def test_a_missing_server_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="No CARLA server answers"):
        record_beside(f"127.0.0.1:{free_port()}", "hero", RIG, tmp_path / "out")


def test_a_server_that_loads_a_map_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []

    def probe(_host: str, _port: int, timeout_s: float) -> str:
        waited.append(timeout_s)
        raise ServerError("timed out")

    monkeypatch.setattr("carstage.runs.following.probe_version", probe)
    with pytest.raises(BadInputError, match="No CARLA server answers"):
        record_beside("127.0.0.1:1", "hero", RIG, tmp_path / "data", wait_s=77.0)
    assert waited == [77.0]


def test_an_ego_that_never_comes_is_bad_input(simulator: RunningSimulator, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="no vehicle 'nobody' appeared"):
        record_beside(address(simulator), "nobody", RIG, tmp_path / "out", wait_s=1.0)


@pytest.mark.parametrize(
    ("rig", "error", "words"),
    [
        ("no-such-rig", BadInputError, "neither a preset nor a file"),
        ({**RIG, "timing": {"mode": "async"}}, ConfigError, "timing"),
        ({**RIG, "patches": BOARD}, ConfigError, "^patches: beside another program"),
        (check_config({**RIG, "patches": BOARD}), ConfigError, "^patches: beside another program"),
        ({**RIG, "senors": []}, ConfigError, "senors: unknown key"),
        ({**RIG, "ego": {"colour": "red"}}, ConfigError, "ego.colour: unknown key"),
        (RIG["rig"], ConfigError, r"Put it below `rig:`, as rig\.sensors"),
        ({"image_size": [64, 36]}, ConfigError, "rig: the configuration has none"),
    ],
)
def test_a_rig_that_does_not_fit_is_refused(
    tmp_path: Path, rig: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        record_beside("127.0.0.1:2000", "hero", rig, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("override", ["vehicles.count=5", "duration_s=3", "server.port=2000"])
def test_an_override_that_cannot_count_is_refused(tmp_path: Path, override: str) -> None:
    with pytest.raises(ConfigError, match=rf"--set {override.partition('=')[0]}: .*not yours"):
        record_beside("127.0.0.1:2000", "hero", RIG, tmp_path / "out", settings=(override,))


def test_the_python_of_the_collector_can_be_chosen() -> None:
    asked, left_out = settings_of(RIG, ("server.client_python=/opt/python",))
    assert asked["server"] == {"client_python": "/opt/python"}
    assert left_out == ()


def test_agents_of_a_file_do_not_count() -> None:
    asked, left_out = settings_of({**RIG, "agents": [{"name": "second", "rig": RIG["rig"]}]}, ())
    assert left_out == ("agents",)
    assert config_of(asked).agents == ()


def test_a_file_is_checked_with_its_own_frame_rate_until_the_program_tells_one() -> None:
    lidar = {"id": "L", "kind": "lidar", "attributes": {"rotation_frequency_hz": 20}}
    asked, left_out = settings_of({"fps": 20, "rig": {"sensors": [lidar]}}, ())
    assert left_out == ("fps",)
    assert config_of(asked).fps == 20.0
    with pytest.raises(ConfigError, match="rotation_frequency_hz"):
        config_of({**asked, "fps": 10.0})


def test_keys_of_a_file_that_do_not_count_are_named(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    rig, said = tmp_path / "rig.yaml", list[RunEvent]()
    rig.write_text(json.dumps({**RIG, "vehicles": {"count": 5}, "fps": 20}))
    with pytest.raises(BadInputError, match="nobody"):
        record_beside(address(simulator), "nobody", rig, tmp_path / "out", said.append, wait_s=1.0)
    assert any("fps, vehicles: the other program decides" in str(event) for event in said)


def test_what_overruns_is_missing_in_the_ledger_with_its_reason(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    # One frame is more than may wait. Depth is drawn fast: the program's many ticks, of which the
    # first are over before the streams are up, take no long time.
    camera = {**RIG["rig"]["sensors"][0], "kind": "depth"}
    large = {"image_size": [640, 480], "rig": {"sensors": [camera, *RIG["rig"]["sensors"][1:]]}}
    with ticking(simulator, 150) as program:
        record_beside(
            address(simulator),
            "hero",
            large,
            out,
            program.on_event,
            settings=("output.raw_queue_mb=1",),
            episodes=1,
        )
    (ledger,) = (pq.read_table(path) for path in out.glob("episodes/*/*/frames.parquet"))
    rows = ledger.to_pylist()
    lost = [row for row in rows if row["CAM.state"] == "missing"]
    assert lost
    assert all("waited for the disk" in row["CAM.reason"] for row in lost)
    assert [row["tick"] for row in rows] == list(range(len(rows)))
    report = carstage.validate(out)
    assert any(problem.check == "ledger_state" for problem in report.problems), report.problems
    assert not report.ok


def test_ctrl_c_keeps_what_is_whole(simulator: RunningSimulator, tmp_path: Path) -> None:
    out, rig = tmp_path / "out", tmp_path / "rig.yaml"
    rig.write_text(json.dumps(FAST_RIG))
    command = [
        *(sys.executable, "-m", "carstage.cli", "record", "--server", address(simulator)),
        *("--ego", "hero", "--rig", str(rig), "--out", str(out)),
    ]
    with ticking(simulator, 8000, by_events=False):
        recorder = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            events = out / "runs"
            await_that(lambda: told(events).count('"event": "tick"') > 2, 120.0)
            recorder.send_signal(signal.SIGINT)
            _, said = recorder.communicate(timeout=60.0)
        finally:
            recorder.kill()
            recorder.communicate()
    assert recorder.returncode == 130, said
    (episode,) = carstage.Dataset(out).episodes
    assert 20 < episode.spec.steps < 8000
    assert carstage.validate(out).ok


def test_what_could_not_be_converted_is_kept_and_converted_by_the_next_recording(
    simulator: RunningSimulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: AttemptCommit) -> int:
        raise ConversionError("the disk of the converters is away", "Bring it back.")

    def recorded() -> RunResult:
        with ticking(simulator, 60) as program:

            def on_event(event: RunEvent) -> None:
                said.append(event)
                program.on_event(event)

            return record_beside(address(simulator), "hero", RIG, out, on_event, episodes=1)

    out, said = tmp_path / "out", list[RunEvent]()
    with monkeypatch.context() as patched:
        patched.setattr(AttemptCommit, "commit", fails)
        ended = recorded()
    assert (ended.state, ended.committed, len(ended.failures)) == ("failed", 0, 1)
    assert any("is kept as it was recorded" in str(event) for event in said)
    (kept,) = ended.failures

    ended = recorded()
    assert (ended.state, ended.committed, ended.total) == ("done", 2, 2)
    assert kept in [episode.id for episode in carstage.Dataset(out).episodes]
    assert carstage.validate(out).ok
    assert not list(out.glob("runs/*/raw/*"))


def told(runs: Path) -> str:
    return "".join(path.read_text() for path in runs.glob("*/events.jsonl"))
