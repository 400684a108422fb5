"""A server that is not CARLA, through a whole run: the one of the how-to, and what is refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import yaml

from carstage import Dataset, validate
from carstage.config import check_config
from carstage.errors import BadInputError, ConfigError
from carstage.runs import RunResult, run
from carstage.runs.allotment import check_ports, config_of_worker, number_of_workers
from carstage.runs.server_lock import server_key
from carstage.server import Server, load_server
from carstage.testing.server import ServerTests
from page_blocks import files_of

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "add-a-simulator.md"
STEP_S = 0.1
HALF = np.array([2.2, 0.9, 0.75])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the files of the page are; what they bring into this process goes again."""
    folder = tmp_path_factory.mktemp("box-world")
    for name, text in files_of(PAGE).items():
        (folder / name).write_text(text)
    path, modules = list(sys.path), set(sys.modules)
    yield folder
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name.startswith("box_world"):
            del sys.modules[name]


@pytest.fixture(scope="module")
def config(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load((folder / "box-world.yaml").read_text())
    document["server"]["folders"] = [str(folder)]
    return {**document, "conversion": {"workers": 1}, "duration_s": 0.5}


class Recorded:
    def __init__(self, result: RunResult, events: list[Any], dataset: Path) -> None:
        self.result, self.events, self.dataset = result, events, dataset


@pytest.fixture(scope="module")
def recorded(folder: Path, config: dict[str, Any]) -> Recorded:
    events: list[Any] = []
    dataset = folder / "dataset"
    return Recorded(run(config, dataset, events.append), events, dataset)


@pytest.mark.end_to_end
def test_server_that_is_not_carla_goes_through_the_whole_run(recorded: Recorded) -> None:
    assert recorded.result.state == "done"
    assert recorded.result.frames == 5
    assert validate(recorded.dataset).ok
    started = next(e for e in recorded.events if type(e).__name__ == "ServerStarted")
    assert started.kind == "box world"
    assert not psutil.pid_exists(started.pid)


@pytest.mark.end_to_end
def test_its_boxes_are_where_the_simulator_has_the_car(recorded: Recorded) -> None:
    (episode,) = Dataset(recorded.dataset).episodes
    (row,) = (row for row in episode.camera_objects().to_pylist() if row["k"] == 4)
    time_s = 5 * STEP_S
    ego, car = 20.0 + 5.0 * time_s, np.array([32.0 + 4.0 * time_s, 2.0, HALF[2]])
    camera = np.array([ego + 2.4, 2.0, 1.6])
    corners = car + HALF * np.array([[-1, y, z] for y in (-1, 1) for z in (-1, 1)]) - camera
    u = 96.0 + 96.0 * corners[:, 1] / corners[:, 0]
    v = 54.0 - 96.0 * corners[:, 2] / corners[:, 0]
    assert row["track_id"] == 2
    assert row["visible"]
    # The near face bounds the outline but above, where the roof's far edge is higher.
    left, _, right, bottom = row["bbox_amodal"]
    assert (left, right, bottom) == pytest.approx((u.min(), u.max(), v.max()), abs=1e-3)
    assert np.abs(np.array(row["bbox_modal"]) - row["bbox_amodal"]).max() < 1.0


@pytest.mark.end_to_end
def test_what_its_collector_refuses_is_not_tried_again(
    folder: Path, config: dict[str, Any]
) -> None:
    rig = {"sensors": [{"id": "CAM", "kind": "rgb", "pose": {"yaw_deg": 30}}]}
    result = run({**config, "rig": rig}, folder / "refused")
    (reason,) = result.failures.values()
    assert "cameras that look ahead alone" in reason
    assert len(list((folder / "refused" / "runs").glob("*/logs/collector-plan-*"))) == 1


def test_sensor_that_it_does_not_offer_is_refused_by_the_plan(
    folder: Path, config: dict[str, Any]
) -> None:
    rig = {"sensors": [{"id": "LIDAR", "kind": "lidar"}]}
    with pytest.raises(ConfigError, match=r"rig.sensors\[0\].kind: this server has no sensor"):
        run({**config, "rig": rig}, folder / "lidar")


class TestBoxWorldServer(ServerTests):
    @pytest.fixture(autouse=True)
    def _files(self, folder: Path) -> None:
        self.folder = folder

    def make(self) -> Server:
        return load_server("box_world_server:BoxWorldServer", [str(self.folder)], {}, None)


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("no_such_module:Server", {}, "there is no module no_such_module"),
        ("box_world_server:Nothing", {}, "has no Nothing"),
        ("box_world_server:BoxWorld", {}, "has no server BoxWorld"),
        ("box_world_server:BoxWorldServer", {"colour": "red"}, "raised TypeError when it was made"),
    ],
)
def test_class_that_cannot_be_is_refused(
    folder: Path, name: str, parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(BadInputError, match=f"server.name: .*{message}"):
        load_server(name, [str(folder)], parameters, None)


def test_name_of_a_class_has_a_module(config: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"server\.name"):
        check_config({**config, "server": {"kind": "class", "name": "BoxWorldServer"}})


def test_workers_have_a_server_of_such_a_class_each(config: dict[str, Any]) -> None:
    checked = check_config(config)
    assert number_of_workers(checked, "auto") == 1
    assert number_of_workers(checked, 3) == 3
    check_ports(checked, 3)
    assert config_of_worker(checked, 2, 3).server == checked.server
    assert server_key(checked) == "here"
