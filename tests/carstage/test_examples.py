"""The programs in ``examples`` run as they stand, and do what they say."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import carstage
from analytic_dataset import make_watched
from carstage.config import load_config
from carstage.dataset import Dataset
from carstage.runs.preflight import judge
from carstage.spec import EVENT_SPECS, ClassDriverSpec, ScenicSpec, StoryboardSpec
from carstage.spec.patches import TARGETS
from recorded_dataset import FRAMES
from scenic_python import scenic_python

EXAMPLES = Path(__file__).parents[2] / "examples"
PATIENCE_S = 240.0

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("recorded")]


def run(name: str, *arguments: object, home: Path | None = None) -> str:
    """Run an example in a process of its own; what it prints."""
    environment = dict(os.environ)
    if home is not None:
        environment.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))
        environment["HOME"] = str(home)
    ended = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *(str(argument) for argument in arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env=environment,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_boxes_are_drawn_on_the_fullest_picture(recorded: Path, tmp_path: Path) -> None:
    told = run("draw_boxes.py", recorded, tmp_path / "boxes.png")
    title, *objects = told.splitlines()
    found = re.fullmatch(r"two drives: episode (\w{16}), frame (\d+), (\w+)", title)
    assert found is not None
    assert objects
    plain = Dataset(recorded).episode(found[1]).sensor(found[3]).read(int(found[2]))
    with Image.open(tmp_path / "boxes.png") as picture:
        drawn = np.asarray(picture)
    assert drawn.shape == plain.shape
    assert 20 < (drawn != plain).any(axis=2).sum() < plain[..., 0].size / 2


def test_labels_answer_queries(recorded: Path) -> None:
    told = run("query_labels.py", recorded)
    assert re.search(r"class car, objects \d+, labels \d+, mean_speed_mps [\d.]+", told)
    assert told.count("distance_m") == 5
    assert "Traffic lights seen" in told


def test_samples_come_from_worker_processes(recorded: Path) -> None:
    told = run("load_samples.py", recorded)
    assert told.startswith(f"{2 * FRAMES} samples of (3, 90, 160), ")
    assert int(told.split()[-2]) > 0


def test_the_ego_is_named_where_a_camera_shows_it(tmp_path: Path) -> None:
    watched = make_watched(tmp_path / "watched", tmp_path)
    told = run("draw_boxes.py", watched, tmp_path / "boxes.png")
    assert "CAM_FRONT" in told
    assert re.search(r"^car +[\d.]+ m", told, re.MULTILINE)
    assert run("load_samples.py", watched).startswith("2 samples of ")


def test_an_export_opens_in_the_devkit(recorded: Path, tmp_path: Path) -> None:
    pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    told = run("open_in_nuscenes.py", recorded, tmp_path / "nuscenes")
    assert told.startswith(f"2 scenes, {2 * FRAMES // 5} samples, ")  # key frames at 2 Hz of 10
    assert "LIDAR_TOP: " in told


def test_a_script_of_ones_own_drives_the_simulator(tmp_path: Path) -> None:
    told = run("drive_simulator.py", tmp_path / "camera.png", home=tmp_path)
    speed = re.search(r"([\d.]+) m/s", told)
    assert speed is not None
    assert float(speed[1]) > 1.0
    with Image.open(tmp_path / "camera.png") as picture:
        assert picture.size == (320, 180)
        assert np.asarray(picture.convert("L")).std() > 10.0


def test_a_script_of_ones_own_is_recorded(tmp_path: Path) -> None:
    told = run("record_own_client.py", tmp_path / "out", home=tmp_path)
    frames = re.match(r"(\d+) frames in ", told)
    assert frames is not None
    assert 15 <= int(frames[1]) <= 20
    assert carstage.validate(tmp_path / "out").ok


def test_the_readme_lists_every_example() -> None:
    readme = (EXAMPLES / "README.md").read_text("utf-8")
    programs = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert len(programs) == 8
    assert re.findall(r"examples/(\w+\.py)", readme) == sorted(
        programs, key=lambda name: readme.index(name)
    )


@pytest.mark.parametrize(
    ("name", "episodes"), [("night_crowds.yaml", 400), ("sweep_lidar.yaml", 5 * 3 * 2)]
)
def test_example_campaigns_can_be_recorded(name: str, episodes: int) -> None:
    plan = judge(load_config(EXAMPLES / name))
    assert len(plan) == len(set(plan.ids)) == episodes
    assert name in (EXAMPLES / "README.md").read_text("utf-8")
    head = [spec.vehicles.count for spec in plan[:30]]
    assert len(set(head)) >= 5


def test_example_events_have_parameters_of_their_own_in_each_episode() -> None:
    plan = judge(load_config(EXAMPLES / "events.yaml"))
    events = [spec.scenario.events or () for spec in plan]
    assert {event.kind for event in events[0]} == set(EVENT_SPECS)
    assert len({each[0].parameters()["speed_m_s"] for each in events}) == len(plan) == 4
    assert "events.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_names_a_driver_of_ones_own() -> None:
    # Its class drives in tests/carstage/runs/test_driving_the_ego.py.
    (spec,) = judge(load_config(EXAMPLES / "own_driver.yaml"))
    assert isinstance(spec.ego.driver, ClassDriverSpec)
    assert spec.ego.driver.name == "own_driver:Waves"
    assert "own_driver.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_asks_for_exact_voxels() -> None:
    plan = judge(load_config(EXAMPLES / "exact_voxels.yaml"))
    assert {spec.labels.occupancy.exact for spec in plan if spec.labels.occupancy} == {True}
    assert [sensor.id for sensor in plan[0].sensors if sensor.kind == "occupancy"] == ["ego.voxels"]
    assert "exact_voxels.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_a_car_and_a_roadside_unit_beside_the_ego() -> None:
    (spec,) = judge(load_config(EXAMPLES / "fleet.yaml"))
    assert [(agent.name, agent.vehicle is None) for agent in spec.agents] == [
        ("car2", False),
        ("mast", True),
    ]
    assert all("LIDAR" in [sensor.id for sensor in agent.sensors] for agent in spec.agents)
    assert "fleet.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_radios_on_cars_and_at_the_roadside() -> None:
    (spec,) = judge(load_config(EXAMPLES / "v2x.yaml"))
    rigs = [spec.sensors, *(agent.sensors for agent in spec.agents)]
    assert all("v2x" in [sensor.kind for sensor in rig] for rig in rigs)
    assert "v2x.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_looks_from_drones_and_from_a_junction() -> None:
    (spec,) = judge(load_config(EXAMPLES / "aerial.yaml"))
    assert [agent.kind for agent in spec.agents] == ["drone", "drone", "junction"]
    assert spec.labels.lane_lines
    assert "aerial.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_a_flash_lidar_and_rotating_ones_by_their_data_sheets() -> None:
    plan = judge(load_config(EXAMPLES / "lidar_products.yaml"))
    found = {sensor.id: sensor for sensor in plan[0].sensors if sensor.kind != "rgb"}
    assert [sensor.kind for sensor in found.values() if not sensor.hidden][:1] == ["flash_lidar"]
    flash = found["FLASH"].flash
    assert flash is not None
    assert (flash.columns, flash.rows, flash.range_m) == (128, 32, 50.0)
    assert found["VLP16"].attributes["channels"] == "16"
    assert "lidar_products.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_a_lidar_that_moves_while_it_turns() -> None:
    spec = judge(load_config(EXAMPLES / "sweeping_lidar.yaml"))[0]
    kinds = [sensor.kind for sensor in spec.sensors if not sensor.hidden]
    assert kinds == ["rgb", "sweeping_lidar", "lidar"]
    assert "sweeping_lidar.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_radars_with_cross_sections() -> None:
    spec = judge(load_config(EXAMPLES / "radar.yaml"))[0]
    kinds = [sensor.kind for sensor in spec.sensors if not sensor.hidden]
    assert kinds == ["rgb", "rcs_radar", "rcs_radar"]
    assert "radar.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_patches_on_every_target_recorded_with_and_without() -> None:
    plan = judge(load_config(EXAMPLES / "patches.yaml"))
    assert len(plan) == 2 * 2
    assert {patch.target for patch in plan[0].patches} == set(TARGETS)
    assert [spec.patches[0].is_shown for spec in plan] == [True, False] * 2
    assert "patches.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_has_each_drive_under_four_skies_and_by_a_fisheye() -> None:
    plan = judge(load_config(EXAMPLES / "variants.yaml"))
    assert len(plan) == 3 * 5
    first = [spec for spec in plan if spec.index == 0]
    names = [spec.variant.name for spec in first if spec.variant is not None]
    assert names == ["noon", "sunset", "rain", "night", "fisheye"]
    assert len({spec.seeds for spec in first}) == 1
    assert not any(spec.wet_grip for spec in first)
    assert "variants.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_names_an_openscenario_file(monkeypatch: pytest.MonkeyPatch) -> None:
    # It is recorded in tests/carstage/runs/test_storyboard.py.
    monkeypatch.chdir(EXAMPLES.parent)
    (spec,) = judge(load_config(EXAMPLES / "openscenario.yaml"))
    assert isinstance(spec.scenario, StoryboardSpec)
    assert [one.name for one in spec.scenario.entities] == ["hero", "overtaker", "pedestrian"]
    assert "openscenario.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


def test_an_example_names_a_scenic_program(monkeypatch: pytest.MonkeyPatch) -> None:
    # It is recorded in tests/carstage/runs/test_scenic.py.
    monkeypatch.chdir(EXAMPLES.parent)
    settings = [f"scenario.python={scenic_python()}"]
    plan = judge(load_config(EXAMPLES / "scenic.yaml", settings))
    assert len(plan) == 3
    assert all(isinstance(spec.scenario, ScenicSpec) for spec in plan)
    assert "scenic.yaml" in (EXAMPLES / "README.md").read_text("utf-8")


AGENTS = """
class Planner:
    def trace_route(self, start, end):
        return [(start, end)]

class {name}:
    def __init__(self, vehicle, first, opt_dict):
        self.made = [vehicle, first, opt_dict]

    def get_global_planner(self):
        return Planner()

    def set_global_plan(self, plan):
        self.made.append(plan)

    def run_step(self):
        return self.made
"""


@pytest.mark.parametrize(
    ("name", "agent", "first"),
    [("Basic", "basic_agent", 30.0), ("Behavior", "behavior_agent", "normal")],
)
def test_carlas_agents_are_given_the_ego_and_its_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, agent: str, first: Any
) -> None:
    # CARLA's own are not installed here; these have the same constructor and the same methods.
    folder = tmp_path / "agents" / "navigation"
    folder.mkdir(parents=True)
    (folder / f"{agent}.py").write_text(AGENTS.format(name=f"{name}Agent"))
    for path in (tmp_path, EXAMPLES):
        monkeypatch.syspath_prepend(path)
    driver = getattr(importlib.import_module("carla_agents"), name)()
    here = SimpleNamespace(location="here")
    observation = SimpleNamespace(ego="ego", step_s=0.1, transform=here, goals=("there", "home"))
    driver.start(observation)
    way = [("here", "there"), ("there", "home")]
    assert driver.drive(observation) == ["ego", first, {"dt": 0.1}, way]
    for module in [one for one in sys.modules if one.split(".")[0] in ("agents", "carla_agents")]:
        del sys.modules[module]


def test_every_example_configuration_is_tested() -> None:
    names = sorted(path.name for path in EXAMPLES.glob("*.yaml"))
    assert names == [
        "aerial.yaml",
        "events.yaml",
        "exact_voxels.yaml",
        "fleet.yaml",
        "lidar_products.yaml",
        "night_crowds.yaml",
        "openscenario.yaml",
        "own_driver.yaml",
        "patches.yaml",
        "radar.yaml",
        "scenic.yaml",
        "sweep_lidar.yaml",
        "sweeping_lidar.yaml",
        "v2x.yaml",
        "variants.yaml",
    ]
