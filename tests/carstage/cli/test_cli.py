"""The command line: exit codes, where output goes, and refusals before anything starts."""

from __future__ import annotations

import errno
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from carstage.cli import unsupported
from carstage.cli.app import app
from carstage.cli.doctor import server_setting
from carstage.config import Config, load_demo, parse_config
from carstage.selftest import Check, Verdict


@pytest.fixture(autouse=True)
def _no_debug(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CARSTAGE_DEBUG", "")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.yaml"
    path.write_text("duration_s: 1\n")
    return path


@pytest.fixture
def port_in_use() -> Iterator[int]:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield int(taken.getsockname()[1])


def invoke(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_version_is_printed() -> None:
    assert invoke("--version").stdout.startswith("carstage 0.")


def test_help_loads_nothing_heavy() -> None:
    heavy = "{'numpy', 'pyarrow', 'pydantic', 'numba', 'carla', 'PIL'}"
    code = f"import sys, carstage.cli.app; sys.exit({heavy} & set(sys.modules) or 0)"
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(("given", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_threads_that_nothing_uses_are_not_started(given: dict[str, str], threads: str) -> None:
    code = (
        "import atexit, os, sys, carstage.cli\n"
        "atexit.register(lambda: print(os.environ['OPENBLAS_NUM_THREADS']))\n"
        "sys.argv = ['carstage', '--version']\n"
        "carstage.cli.main()"
    )
    environment = {name: os.environ[name] for name in os.environ if "OPENBLAS" not in name}
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env=environment | given, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ended.stdout.split()[-1] == threads


@pytest.mark.parametrize(
    ("machine", "named"),
    [
        (("Darwin", "arm64", (3, 11)), "Linux on x86-64, this is Darwin on arm64"),
        (("Windows", "AMD64", (3, 11)), "Linux"),
        (("Linux", "aarch64", (3, 11)), "aarch64"),
        (("Linux", "x86_64", (3, 9)), "Python 3.10, 3.11 or 3.12, this is 3.9"),
        (("Linux", "x86_64", (3, 13)), "this is 3.13"),
    ],
)
def test_unsupported_machine_is_one_sentence_about_it(
    machine: tuple[str, str, tuple[int, int]], named: str
) -> None:
    problem = unsupported(*machine)
    assert problem is not None
    assert named in problem
    assert "\n" not in problem


@pytest.mark.parametrize("version", [(3, 10), (3, 11), (3, 12)])
def test_supported_machine_is_no_problem(version: tuple[int, int]) -> None:
    assert unsupported("Linux", "x86_64", version) is None


def test_config_init_prints_the_defaults() -> None:
    ended = invoke("config", "init")
    assert ended.exit_code == 0
    assert parse_config(ended.stdout) == Config()


def test_config_init_replaces_no_file_unless_told(config: Path) -> None:
    before = config.read_text()
    refused = invoke("config", "init", config)
    assert refused.exit_code == 2
    assert "exists already" in refused.stderr
    assert config.read_text() == before
    assert invoke("config", "init", config, "--force").exit_code == 0
    assert parse_config(config.read_text()) == Config()


def test_config_schema_is_json() -> None:
    schema = json.loads(invoke("config", "schema").stdout)
    assert schema["properties"]["fps"]["unit"] == "Hz"


def test_config_presets_lists_the_rigs_with_their_sources() -> None:
    text = invoke("config", "presets").stdout
    assert text.startswith("demo: ")
    assert "nuscenes: nuScenes' six cameras" in text
    document = json.loads(invoke("config", "presets", "--json").stdout)
    assert len(document["kitti"]["sensors"]) == 5
    assert "IJRR 2013" in document["kitti"]["source"]


def test_config_check_warns_of_partial_sweeps(config: Path) -> None:
    sensors = "[{id: L, kind: lidar, attributes: {rotation_frequency_hz: 5}}]"
    config.write_text(f"rig: {{sensors: {sensors}}}\n")
    assert "warning: rig.sensors[0].attributes" in invoke("config", "check", config).stdout


def test_config_check_says_what_would_be_recorded(config: Path) -> None:
    ended = invoke("config", "check", config, "--set", "episodes=3", "--json")
    assert ended.exit_code == 0, ended.stderr
    summary = json.loads(ended.stdout.splitlines()[-1])
    assert (summary["episodes"], summary["frames"], summary["hidden_sensors"]) == (3, 30, 2)


BAD = {
    "unknown key": (["--set", "fsp=3"], "fsp: unknown key 'fsp'. Did you mean 'fps'?"),
    "negative fps": (["--set", "fps=-5"], "fps: -5 is too small"),
    "sub-stepping": (
        ["--set", "timing.substepping={max_substep_delta_time_s: 0.01, max_substeps: 2}"],
        "timing.substepping: 2 sub-steps",
    ),
    "two of one name": (
        ["--set", "rig.sensors=[{id: A, kind: rgb}, {id: A, kind: imu}]"],
        "rig.sensors[1].id: 'A' is the id of another sensor",
    ),
    "unknown blueprint": (
        ["--set", "ego.blueprint=vehicle.tesla.model_3"],
        "ego.blueprint: unknown blueprint 'vehicle.tesla.model_3'. Did you mean "
        "'vehicle.tesla.model3'?",
    ),
    "unknown map": (["--set", "map=Stage1"], "map.choice: unknown map 'Stage1'. Did you mean"),
    "spawn point": (["--set", "ego.spawn=100000"], "ego.spawn: Stage01 has no spawn point"),
    "carla that is not there": (
        ["--set", "server={kind: carla, path: /nowhere/carla}"],
        "server.path: there is no CARLA server in /nowhere/carla",
    ),
    "codec": (["--set", "conversion.codecs={CAM_FRONT: jpg}"], "conversion.codecs.CAM_FRONT: "),
    "too much for any disk": (
        ["--set", "duration_s=86400", "--set", "fps=100", "--set", "image_size=[16384, 16384]"],
        "output: the run needs about",
    ),
}


@pytest.mark.parametrize(("settings", "sentence"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_refused_before_anything_starts(
    settings: list[str], sentence: str, config: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    ended = invoke("run", config, "--out", out, *settings)
    assert ended.exit_code == 2, ended.output
    assert sentence in " ".join(ended.stderr.split())
    assert "Traceback" not in ended.output
    assert ended.stdout == ""
    assert not out.exists()


def test_port_in_use_is_refused(config: Path, tmp_path: Path, port_in_use: int) -> None:
    setting = f"server={{kind: embedded, port: {port_in_use}}}"
    ended = invoke("run", config, "--out", tmp_path / "dataset", "--set", setting)
    assert ended.exit_code == 2
    assert f"server.port: port {port_in_use} on 127.0.0.1 is in use" in ended.stderr


def test_remote_server_that_does_not_answer_is_refused(config: Path, tmp_path: Path) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
        setting = f"server={{kind: remote, host: 127.0.0.1, port: {port}}}"
        ended = invoke("run", config, "--out", tmp_path / "dataset", "--set", setting)
    assert ended.exit_code == 2
    assert f"server.host: nothing answers at 127.0.0.1:{port}" in ended.stderr


@pytest.mark.parametrize("out", ["/proc/dataset", "{config}/dataset", "{config}"])
def test_output_that_cannot_be_written_is_refused(config: Path, out: str) -> None:
    ended = invoke("run", config, "--out", out.format(config=config))
    assert ended.exit_code == 2, ended.output
    assert ended.stderr.startswith("Error: output: ")
    assert "--out" in ended.stderr


def test_missing_configuration_is_refused(tmp_path: Path) -> None:
    ended = invoke("run", tmp_path / "none.yaml", "--out", tmp_path / "dataset")
    assert ended.exit_code == 2
    assert "none.yaml cannot be read" in ended.stderr
    assert "config init" in ended.stderr


@pytest.mark.parametrize("arguments", [["rum"], ["run"], ["run", "--nonsense"], ["config", "chek"]])
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    assert invoke(*arguments).exit_code == 2


def test_traceback_is_shown_with_debug_only(config: Path, tmp_path: Path) -> None:
    arguments = ["run", str(config), "--out", str(tmp_path / "out"), "--set", "fps=-1"]
    command = [sys.executable, "-m", "carstage.cli", *arguments]
    environment = {key: value for key, value in os.environ.items() if key != "CARSTAGE_DEBUG"}
    quiet, loud = (
        subprocess.run(
            [*command, *more], capture_output=True, text=True, env=environment, check=False
        )
        for more in ([], ["--debug"])
    )
    assert quiet.returncode == 2
    assert "Traceback" not in quiet.stderr
    assert "ConfigError" in loud.stderr
    assert "Traceback" in loud.stderr


def test_folder_that_is_no_dataset_is_a_sentence(tmp_path: Path) -> None:
    for name in ("validate", "report"):
        ended = invoke(name, tmp_path)
        assert ended.exit_code in (1, 2)
        assert ended.stderr.startswith("Error: ")


def test_sim_hands_its_arguments_to_the_simulator() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "carstage.cli", "sim", "--prot", "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    assert "did you mean --protocol" in ended.stderr or "did you mean --port" in ended.stderr


def test_doctor_examines_this_machine(tmp_path: Path) -> None:
    ended = invoke("doctor", "--out", tmp_path, "--json")
    document = json.loads(ended.stdout.splitlines()[-1])
    assert document["ok"], document
    names = {check["name"] for check in document["checks"]}
    assert {"platform", "carla client", "embedded simulator", "disk", "ports"} <= names


@pytest.mark.parametrize(
    ("server", "setting"),
    [
        ("embedded", {"kind": "embedded"}),
        ("localhost:2000", {"kind": "remote", "host": "localhost", "port": 2000}),
        ("~/CARLA 0.9.15", {"kind": "carla", "path": "~/CARLA 0.9.15"}),
        ("./a:2000/CARLA", {"kind": "carla", "path": "./a:2000/CARLA"}),
    ],
)
def test_doctor_understands_servers(server: str, setting: dict[str, object]) -> None:
    found = load_demo([server_setting(server)]).server.model_dump()
    assert {key: found[key] for key in setting} == setting


@pytest.mark.parametrize("holds", [True, False])
def test_doctor_puts_a_server_to_the_self_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, holds: bool
) -> None:
    check = Check("LiDAR axes", holds, "x forward, y left, z up", "x forward, y right, z up", 0.9)
    verdict = Verdict("0.9.15", "0.9.15", "Town10HD", (check,))
    monkeypatch.setattr("carstage.runs.examine_server", lambda config, say: verdict)
    monkeypatch.setattr("carstage.cli.doctor.examine", lambda out: [])
    arguments = ("doctor", "--out", tmp_path, "--server", "localhost:2000")
    ended = invoke(*arguments, "--json")
    document = json.loads(ended.stdout.splitlines()[-1])
    assert ended.exit_code == (0 if holds else 1)
    assert document["ok"] is holds
    assert document["self_test"]["checks"][0]["found"] == "x forward, y left, z up"
    assert check.line() in invoke(*arguments).stdout


def test_error_of_the_system_is_a_sentence_not_a_bug(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "events.jsonl")

    monkeypatch.setattr("carstage.runs.running.RunFolder.write_plan", full)
    ended = invoke("run", config, "--out", tmp_path / "dataset")
    assert ended.exit_code == 1
    assert ended.stderr.splitlines()[-2:] == [
        "Error: No space left on device: events.jsonl",
        "Check free space and permissions, then run the same command again.",
    ]


def test_error_that_nobody_expected_is_called_a_bug(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(*_: object) -> None:
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("carstage.runs.running.plan_episodes", wrong)
    ended = invoke("run", config, "--out", tmp_path / "dataset")
    assert ended.exit_code == 1
    assert "bug in Car-STAGE: ZeroDivisionError: oops" in ended.stderr
    assert "--debug" in ended.stderr
