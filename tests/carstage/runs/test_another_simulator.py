"""A server that is not CARLA, through a whole run: the one of the how-to, and what is refused."""

from __future__ import annotations

import subprocess
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
from carstage.errors import BadInputError, ConfigError, ServerError
from carstage.execution.collector_process import interpreter_command
from carstage.runs import RunResult, run
from carstage.runs.allotment import check_ports, config_of_worker, number_of_workers
from carstage.runs.selftesting import examine_server
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


RAISING = """
import statistics
from carstage.errors import ServerError
from carstage.server import Endpoint, Server


class Raising(Server):
    kind = "raising"
    answer = None

    def __init__(self, log_path=None):
        super().__init__()

    def start(self):
        self._endpoint = Endpoint("127.0.0.1", 1, 2, "0.9.16", None)
        return {}["port"]

    def facts(self):
        return self.answer

    def stop(self):
        self.alive()

    def alive(self):
        raise ServerError("It has no power.", "Plug it in.")

    def log_tail(self, lines=20):
        return ""


class Incomplete(Server):
    kind = "incomplete"

    def __init__(self, log_path=None):
        super().__init__()
"""


@pytest.fixture
def raising(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a server that raises, and with a module that is named as one of Python's."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "statistics", raising=False)
    (tmp_path / "raising_server.py").write_text(RAISING)
    (tmp_path / "statistics.py").write_text("raise AssertionError('of the folder')\n")
    yield tmp_path
    sys.modules.pop("raising_server", None)


def test_what_a_class_raises_names_class_method_cause_and_place(raising: Path) -> None:
    server = load_server("raising_server:Raising", [str(raising)], {}, None)
    wanted = (
        r"raising_server:Raising.start\(\) raised KeyError: 'port', in .*raising_server.py, line 16"
    )
    with pytest.raises(ServerError, match=wanted) as caught:
        server.start()
    assert "carstage.errors.ServerError" in caught.value.hint
    with pytest.raises(ServerError, match=r"facts\(\) returned NoneType, not ServerFacts"):
        server.facts()


def test_errors_of_car_stage_pass_as_they_are(raising: Path) -> None:
    server = load_server("raising_server:Raising", [str(raising)], {}, None)
    with pytest.raises(ServerError, match="It has no power") as caught:
        server.stop()
    assert caught.value.hint == "Plug it in."


def test_class_without_a_method_that_is_needed_is_refused(raising: Path) -> None:
    with pytest.raises(BadInputError, match=r"raised TypeError when it was made.*abstract"):
        load_server("raising_server:Incomplete", [str(raising)], {}, None)


def test_module_of_a_folder_takes_the_place_of_none_that_is_installed(raising: Path) -> None:
    load_server("raising_server:Raising", [str(raising)], {}, None)
    assert Path(str(sys.modules["statistics"].__file__)).parent != raising


def test_collector_of_a_folder_is_run_with_its_neighbours_and_with_what_is_installed(
    tmp_path: Path,
) -> None:
    (tmp_path / "statistics.py").write_text("raise AssertionError('of the folder')\n")
    (tmp_path / "own_part.py").write_text("WORD = 'mine'\n")
    code = "import statistics, sys, own_part\nprint(own_part.WORD, __name__, sys.argv[1:])\n"
    (tmp_path / "own_collector.py").write_text(code)
    command = interpreter_command(sys.executable, "own_collector", [str(tmp_path)])
    said = subprocess.run(
        [*command, "plan"], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert said.stdout.split(None, 2) == ["mine", "__main__", "['plan']\n"]


def test_self_test_of_a_server_that_is_not_carla_is_refused(config: dict[str, Any]) -> None:
    with pytest.raises(
        BadInputError, match=r"server.name: box_world_server:BoxWorldServer records"
    ):
        examine_server(check_config(config), lambda sentence: None)
