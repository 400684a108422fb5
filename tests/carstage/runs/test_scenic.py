"""A Scenic program drives an episode as it drives a world of its own."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pytest

import carstage
from carstage.config import check_config
from carstage.dataset import Episode
from carstage.errors import ConfigError
from carstage.runs import record_beside
from carstage.runs.events import OtherEvent, RunEvent
from carstage.runs.programs import read_program
from carstage.spec import ScenicSpec
from running_simulator import RunningSimulator
from scenic_python import scenic_python

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.xdist_group("following"),
    pytest.mark.timeout(900),  # Scenic reads a map for a minute or two
]

WARM_UP, FRAMES, STEP_S = 8, 12, 0.1
EXAMPLES = Path(__file__).parents[3] / "examples"
OWN_PROGRAM = Path(__file__).parents[2] / "support" / "scenic_own_program.py"
PROGRAM = """
param carla_map = 'Stage01'
param speed = 9
param stop_after = 100
model scenic.simulators.carla.model

behavior Drive(speed):
    do FollowLaneBehavior(speed)

lane = Uniform(*network.lanes)
lead = new Car on lane.centerline, with behavior Drive(6)
ego = new Car following roadDirection from lead for Range(-20, -12),
    with behavior Drive(globalParameters.speed), with rolename 'hero'
new Pedestrian right of ego by 6, with regionContainedIn None
terminate after globalParameters.stop_after seconds
"""
OF_THE_EPISODE = {"k", "tick", "timestamp_s", "episode_id", "instance_uid"}
"""Columns that say which episode and which frame of it; all others are of the world."""


def configuration(program: Path, **changes: Any) -> dict[str, Any]:
    scenario = {"kind": "scenic", "file": str(program), "python": str(scenic_python())}
    return {
        "seed": 5,
        "weather": {"choice": "ClearNoon"},
        "fps": round(1 / STEP_S),
        "duration_s": FRAMES * STEP_S,
        "timing": {"warmup_ticks": WARM_UP},
        "image_size": [64, 36],
        "min_lidar_points": 0,
        "conversion": {"workers": 1},
        "rig": {"sensors": [{"id": "CAM", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}}]},
        **changes,
        "scenario": {**scenario, **changes.get("scenario", {})},
    }


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("program") / "lanes.scenic"
    path.write_text(PROGRAM)
    return path


def run(simulator: RunningSimulator, out: Path, config: dict[str, Any]) -> Episode:
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port, "self_test": "off"}
    carstage.run({**config, "server": at}, out, retries=0)
    (episode,) = carstage.Dataset(out).episodes
    return episode


class Drives(NamedTuple):
    """The same program recorded twice; rows by the number of the program's tick."""

    run: Episode
    beside: Episode
    ticks_of_the_run: dict[int, int]
    ticks_beside: dict[int, int]


@pytest.fixture(scope="module")
def drives(
    simulator: RunningSimulator, program: Path, tmp_path_factory: pytest.TempPathFactory
) -> Drives:
    folder = tmp_path_factory.mktemp("scenic")
    config = configuration(program)
    first = run(simulator, folder / "run", config)
    (folder / "Stage01.xodr").write_text(first.opendrive())
    seed = str(first.spec.seeds.spawn)
    ticks = str(WARM_UP + FRAMES)
    own = subprocess.Popen(
        [
            *(str(scenic_python()), str(OWN_PROGRAM), simulator.host),
            *(str(simulator.port), str(program), "Stage01", str(folder / "Stage01.xodr")),
            *(seed, str(STEP_S), ticks),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert own.stdin is not None
    assert own.stdout is not None

    def on_event(event: RunEvent) -> None:
        if isinstance(event, OtherEvent) and event.name == "following":
            own.stdin.write("go\n")
            own.stdin.flush()

    try:
        lines = (line.split() for line in own.stdout)
        _, ego, first_frame = next(words for words in lines if words[:1] == ["ready"])
        address = f"{simulator.host}:{simulator.port}"
        asked = {key: value for key, value in config.items() if key != "scenario"}
        out = folder / "beside"
        record_beside(address, ego, check_config(asked), out, on_event, episodes=1)
        own.communicate(timeout=120.0)
    finally:
        own.kill()
        own.communicate()
    assert own.returncode == 0
    (beside,) = carstage.Dataset(out).episodes
    begin = min(row["server_frame"] for row in first.ledger().to_pylist())
    return Drives(
        first,
        beside,
        # One step shows everybody, then comes the warm-up.
        {row["server_frame"] - begin + WARM_UP + 2: row["k"] for row in first.ledger().to_pylist()},
        {
            row["server_frame"] - int(first_frame) + 1: row["k"]
            for row in beside.ledger().to_pylist()
        },
    )


def road_users(table: pa.Table, ticks: dict[int, int], users: set[int]) -> dict[int, list[Any]]:
    """What a table says of the program's actors, by tick."""
    names = [name for name in table.column_names if name not in OF_THE_EPISODE]
    numbers = {k: tick for tick, k in ticks.items()}
    found: dict[int, list[Any]] = {tick: [] for tick in ticks}
    for row in table.to_pylist():
        if row.get("track_id", 0) in users or "track_id" not in row:
            found[numbers[row["k"]]].append({name: row[name] for name in names})
    return found


@pytest.mark.parametrize("name", ["ego", "objects", "camera_objects"])
def test_labels_equal_those_recorded_beside_the_program(drives: Drives, name: str) -> None:
    users = {int(one) for one in drives.run.document["actors"]}
    assert len(users) == 3
    common = drives.ticks_of_the_run.keys() & drives.ticks_beside.keys()
    assert len(common) >= FRAMES - 2
    expected = road_users(getattr(drives.run, name)(), drives.ticks_of_the_run, users)
    found = road_users(getattr(drives.beside, name)(), drives.ticks_beside, users)
    assert any(expected.values())
    for tick in sorted(common):
        assert len(found[tick]) == len(expected[tick])
        for one, other in zip(found[tick], expected[tick], strict=True):
            different = {key for key in other if one[key] != other[key]}
            assert not different, f"tick {tick}: {[(k, one[k], other[k]) for k in different]}"


def test_the_program_and_its_parameters_are_part_of_the_episode(
    drives: Drives, program: Path
) -> None:
    spec = drives.run.spec.scenario
    assert isinstance(spec, ScenicSpec)
    assert spec.program.startswith("sha256:")
    assert spec.version.startswith("3.")
    config = configuration(program, scenario={"params": {"speed": 4}})
    assert check_config(config).scenario.params == {"speed": 4}


def test_a_program_that_ends_early_leaves_everybody_standing(
    simulator: RunningSimulator, program: Path, tmp_path: Path
) -> None:
    config = configuration(program, duration_s=3.0, scenario={"params": {"stop_after": 1.5}})
    episode = run(simulator, tmp_path / "out", config)
    speed = np.array(episode.ego()["speed"].to_pylist())
    assert len(speed) == 30
    assert speed[:5].max() > 0.3
    assert speed[-1] < 0.05


def test_in_the_example_the_ego_stops_behind_a_car_that_brakes(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    config = configuration(
        EXAMPLES / "braking_leader.scenic", scenario={"params": {"ego_speed": 10}}, duration_s=12.0
    )
    rows = run(simulator, tmp_path / "out", config).objects().to_pylist()
    actors = [row for row in rows if row["class"] == "car" and not row["is_static"]]
    ego, leader = ([row for row in actors if row["is_ego"] is is_ego] for is_ego in (True, False))
    for one in (ego, leader):
        speed = np.array([np.linalg.norm(row["velocity"]) for row in one])
        assert speed.max() > 4.0
        assert speed[-1] < 0.05
    lengths_m = ego[0]["box_extent"][0] + leader[0]["box_extent"][0]
    assert lengths_m < leader[-1]["distance_ego"] < 15.0
    assert max(row["distance_ego"] for row in leader) > 25.0


def test_what_the_program_raises_is_told_with_its_place(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.scenic"
    path.write_text(PROGRAM.replace("lane.centerline", "lanes.centerline"))
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port, "self_test": "off"}
    result = carstage.run({**configuration(path), "server": at}, tmp_path / "out", retries=0)
    (problem,) = result.failures.values()
    assert re.search(r"scenario\.file: .*lanes.*wrong\.scenic, line 11", problem)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"file": "missing.scenic"}, r"scenario\.file: missing\.scenic cannot be read"),
        ({"file": "/dev/zero"}, r"scenario\.file: /dev/zero cannot be read"),
        ({"python": "/bin/false"}, r"scenario\.python: /bin/false lacks what is needed"),
        ({"python": "no/such/python"}, r"scenario\.python: .* cannot be run"),
    ],
)
def test_what_cannot_run_is_refused_with_the_setting(
    program: Path, settings: dict[str, str], message: str
) -> None:
    config = check_config({"scenario": {"kind": "scenic", "file": str(program), **settings}})
    with pytest.raises(ConfigError, match=message):
        read_program(config.scenario)


@pytest.mark.parametrize(
    ("line", "given", "town"),
    [
        ("param carla_map = 'Town05'", None, "Town05"),
        ('param carla_map = "Town05"  # or another', None, "Town05"),
        ("param map = localPath('../maps/Town03.xodr')", None, "Town03"),
        ("param carla_map = 'Town05'", "Stage02", "Stage02"),
        ("param map = somewhere()", None, None),
    ],
)
def test_the_map_is_the_one_that_the_program_names_or_the_setting(
    tmp_path: Path, line: str, given: str | None, town: str | None
) -> None:
    path = tmp_path / "a.scenic"
    path.write_text(f"{line}\nmodel scenic.simulators.carla.model\n")
    document = {"kind": "scenic", "file": str(path), "python": str(scenic_python()), "map": given}
    scenario = check_config({"scenario": document}).scenario
    if town is None:
        with pytest.raises(ConfigError, match=r"scenario\.map: .* names no map"):
            read_program(scenario)
    else:
        assert read_program(scenario).map == town


def test_the_environment_of_scenic_is_one_of_its_own() -> None:
    """Scenic brings ``opencv-python``; ours is ``opencv-python-headless``: both own ``cv2``."""
    ask = "import importlib.metadata as m; print(*(d.name for d in m.distributions()))"
    told = subprocess.run(
        [str(scenic_python()), "-I", "-c", ask], capture_output=True, text=True, check=True
    )
    names = {name.lower() for name in told.stdout.split()}
    assert {"scenic", "carla", "opencv-python"} <= names
    assert not {"carstage", "opencv-python-headless"} & names
