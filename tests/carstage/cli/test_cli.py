"""The command line: exit codes, where output goes, and refusals before anything starts."""

from __future__ import annotations

import errno
import gc
import io
import json
import os
import pty
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner, Result

from carstage.cli import output, unsupported
from carstage.cli.app import app, narrowed
from carstage.cli.doctor import server_setting
from carstage.cli.loading import loading
from carstage.config import Config, check_config, dump_config, load_demo, parse_config
from carstage.runs import RunResult
from carstage.selftest import Check, Verdict
from carstage.storage import CommitMarker, FileEntry


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


def test_a_command_is_made_alone_and_stays_what_it_is() -> None:
    for arguments in (["run"], ["config", "check"], ["runs"], ["catalog", "show"]):
        alone = narrowed(arguments)
        assert len(alone.registered_commands) + len(alone.registered_groups) == 1
        asked = [*arguments, "--help"]
        assert CliRunner().invoke(alone, asked).stdout == CliRunner().invoke(app, asked).stdout


@pytest.mark.parametrize(
    "arguments", [[], ["--help"], ["--help", "run"], ["rum"], ["config-check"]]
)
def test_without_a_command_all_of_them_are_made(arguments: list[str]) -> None:
    assert narrowed(arguments) is app
    assert app.registered_groups


def test_help_loads_nothing_heavy() -> None:
    heavy = "{'numpy', 'pyarrow', 'pydantic', 'numba', 'carla', 'PIL'}"
    code = f"import sys, carstage.cli.app; sys.exit({heavy} & set(sys.modules) or 0)"
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr


def test_a_run_of_a_lidar_loads_nothing_that_others_need() -> None:
    """Command line, configuration, run and conversion: each module costs every run its time."""
    others = [
        *("numba", "llvmlite", "PIL", "pandas", "cv2", "scipy", "shapely", "jsonschema", "rich"),
        *("asyncio", "http.client", "urllib.request", "xml.etree", "multiprocessing", "sqlite3"),
        *("duckdb", "pyarrow.dataset", "obstore", "fastapi", "uvicorn", "carla", "unittest"),
        *("carstage.annotation.camera_rows", "carstage.annotation.object_rows", "carstage.bench"),
        *("carstage.birds_eye", "carstage.exporters.exporter", "carstage.lane_lines"),
        *("carstage.occupancy", "carstage.report", "carstage.validation", "carstage.web"),
    ]
    code = (
        "import sys, carstage.cli.app, carstage.cli.progress\n"
        "from carstage.config import parse_config\n"
        "from carstage.conversion.libraries import import_libraries\n"
        "from carstage.runs import run\n"
        "parse_config('{rig: {sensors: [{id: TOP, kind: lidar}]}, labels: {cameras: []}}')\n"
        "import_libraries(pictures=False)\n"
        f"print(*{{*{others}}} & {{*sys.modules}})"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []


@pytest.mark.parametrize(
    ("name", "default", "other"),
    [
        ("OPENBLAS_NUM_THREADS", "1", "3"),
        ("JE_ARROW_MALLOC_CONF", "background_thread:false", "background_thread:true"),
    ],
)
def test_threads_that_nothing_uses_are_not_started(name: str, default: str, other: str) -> None:
    code = (
        "import atexit, os, sys, carstage.cli\n"
        f"atexit.register(lambda: print(os.environ['{name}']))\n"
        "sys.argv = ['carstage', '--version']\n"
        "carstage.cli.main()"
    )
    environment = {key: os.environ[key] for key in os.environ if key != name}
    for given, threads in (({}, default), ({name: other}, other)):
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


@pytest.mark.parametrize(
    ("rig", "told"), [("CAM, kind: rgb", "1 sensor (and 2 hidden"), ("G, kind: gnss", "1 sensor, ")]
)
def test_config_check_counts_sensors_in_words(config: Path, rig: str, told: str) -> None:
    config.write_text(f"rig: {{sensors: [{{id: {rig}}}]}}\n")
    assert told in invoke("config", "check", config).stdout


def test_a_run_that_was_interrupted_is_not_said_to_have_recorded_nothing(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = RunResult("r", tmp_path, tmp_path, "interrupted", 3, 0, 0, 0)
    monkeypatch.setattr("carstage.runs.run", lambda *_, **__: ended)
    told = invoke("run", config, "--out", tmp_path / "out").stderr
    assert "Interrupted: 0 of 3 episodes are in the dataset." in told
    assert "Nothing was recorded" not in told


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
        ["--set", "duration_s=86400", "--set", "fps=100", "--set", "image_size=[4000, 4000]"],
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


@pytest.fixture
def dataset_of_others(tmp_path: Path) -> Path:
    """A dataset with an episode at 20 Hz; the tests' configuration has 10."""
    out = tmp_path / "dataset"
    (out / "commits").mkdir(parents=True)
    (out / "dataset.json").write_text('{"format_version": 1}')
    marker = CommitMarker("e" * 16, "a1", 1, (FileEntry("episode.json", 2, "blake3:00"),), {})
    attempt = out / "episodes" / marker.episode_id / marker.attempt
    attempt.mkdir(parents=True)
    (attempt / "episode.json").write_text("{}")
    (out / "commits" / f"{marker.episode_id}.json").write_bytes(marker.to_bytes())
    run = out / "runs" / "first"
    run.mkdir(parents=True)
    config = dump_config(check_config({"fps": 20, "duration_s": 1}))
    plan = {"config": config, "episodes": [{"episode_id": marker.episode_id}]}
    (run / "plan.json").write_text(json.dumps(plan))
    return out


def test_other_settings_do_not_go_into_a_dataset_unasked(
    config: Path, dataset_of_others: Path
) -> None:
    ended = invoke("run", config, "--out", dataset_of_others)
    assert ended.exit_code == 2
    assert "fps is 10.0, was 20.0" in ended.stderr
    assert "--append" in ended.stderr
    assert not (dataset_of_others / "leases").exists()


@pytest.mark.parametrize("answer", ["n\n", "y\n", pytest.param("\x04", id="ctrl-d")])
def test_on_a_terminal_the_user_is_asked(
    answer: str, config: Path, dataset_of_others: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    config.write_text("duration_s: 1\nmap: nowhere\n")  # what comes after a yes is refused, too
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "carstage.cli", "run", str(config)]
    with os.fdopen(ours, "r+b", buffering=0) as terminal:
        ended = subprocess.Popen(
            [*command, "--out", str(dataset_of_others)], stdin=theirs, stdout=theirs, stderr=theirs
        )
        os.close(theirs)
        said = b""
        while not said.rstrip().endswith(b"[y/N]:"):
            said += terminal.read(1000)
        terminal.write(answer.encode())
        with suppress(OSError):  # how a terminal tells that nobody writes any more
            while more := terminal.read(1000):
                said += more
    assert ended.wait() == 2
    assert b"fps is 10.0, was 20.0" in said
    assert (b"--append" in said) == (answer != "y\n")
    assert (b"Error: map" in said) == (answer == "y\n")


def test_ctrl_c_at_a_question_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    def pressed(_: str) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "stdin", Terminal())
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(f"{typer.confirm.__module__}.visible_prompt_func", pressed)
    with pytest.raises(typer.Exit) as ended:
        output.command(lambda: output.confirmed("All of it goes.", "Remove it?"))()
    assert ended.value.exit_code == 130


#: What is wrong in a configuration, each in another way, and the path that both commands name.
WRONG = {
    "map: nowhere": "map.choice",
    "map: ../x": "map.choice",
    "map: Stage01/../../x": "map.choice",
    "map: {random_from: [Stage01, nowhere]}": "map.random_from[1]",
    "map: {random_from: ['..']}": "map.random_from[0]",
    "map: {layers: [Cellar]}": "map.layers[0]",
    "ego: {blueprint: vehicle.no}": "ego.blueprint",
    "ego: {blueprint: walker.pedestrian.0001}": "ego.blueprint",
    "ego: {spawn: 214}": "ego.spawn",
    "ego: {spawn: -1}": "ego.spawn",
    "vehicles: {filter: 'sensor.*'}": "vehicles.filter",
    "vehicles: {generation: '9'}": "vehicles.generation",
    "vehicles: {groups: [{count: 1, filter: nothing}]}": "vehicles.groups[0].filter",
    "vehicles: {groups: [{count: 1, base_type: plane}]}": "vehicles.groups[0].base_type",
    "pedestrians: {filter: 'vehicle.*'}": "pedestrians.filter",
    "conversion: {codecs: {CAM_FRONT: jpg}}": "conversion.codecs.CAM_FRONT",
    "conversion: {codecs: {NONE: png}}": "conversion.codecs.NONE",
    "conversion: {workers: 0}": "conversion.workers",
    "server: {client_python: /nowhere/python}": "server.client_python",
    "server: {client_python: /etc/passwd}": "server.client_python",
    "server: {kind: carla, path: /nowhere}": "server.path",
    "server: {kind: remote, port: 1}": "server.host",
    "server: {carla_version: 0.9.12}": "server.carla_version",
    "server: {kind: dream}": "server",
    "image_size: [9000, 100]": "image_size: ",
    "image_size: [8000, 8000]": "image_size: ",
    "image_size: [0, 100]": "image_size",
    "rig: {preset: none}": "rig.preset",
    "rig: {sensors: [{id: L, kind: lidar, attributes: {channels: 2000}}]}": "rig.sensors[0]",
    "rig: {sensors: [{id: L, kind: lidar, attributes: {points_per_second: 3e7}}]}": "points_per",
    "rig: {sensors: [{id: L, kind: lidar, attributes: {points_per_second: 30000000}}]}": "rig.",
    "rig: {sensors: [{id: L, kind: lidar, attributes: {range_m: -1}}]}": "rig.sensors[0]",
    "rig: {sensors: [{id: L, kind: rgb, attributes: {fov_deg: 180}}]}": "rig.sensors[0]",
    "rig: {sensors: [{id: L, kind: sonar}]}": "rig.sensors[0].kind",
    "labels: {cameras: [NONE]}": "labels.cameras[0]",
    "scenario: {kind: replay, episode: /nowhere}": "scenario.episode",
    "weather: Sunny": "weather.choice",
    "fps: .inf": "fps",
    "duration_s: 1e30": "duration_s",
    "episodes: 1.5": "episodes",
    "seed: -1": "seed",
    "name: ''": "name",
    "nonsense: 1": "nonsense",
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: str(text)[:60])
def test_config_check_says_what_a_run_would_say(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("a server was started")

    monkeypatch.setattr("carstage.server.process.ServerProcess.__init__", never)
    path = tmp_path / "config.yaml"
    path.write_text(f"duration_s: 1\n{text}\n" if "duration_s" not in text else text)
    checked = invoke("config", "check", path)
    ran = invoke("run", path, "--out", tmp_path / "out")
    assert (checked.exit_code, ran.exit_code) == (2, 2), checked.output + ran.output
    assert WRONG[text] in checked.stderr
    assert checked.stderr == ran.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("server", "offline"),
    [("{kind: remote, port: 1}", True), ("{kind: remote, port: 1}", False), ("{}", True)],
)
def test_offline_leaves_out_what_only_another_server_knows(
    server: str, offline: bool, tmp_path: Path
) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(f"map: Elsewhere\nserver: {server}\n")
    ended = invoke("config", "check", path, *(["--offline"] if offline else []))
    assert ended.exit_code == (0 if offline and "remote" in server else 2), ended.output


def test_bad_datasets_are_bad_input(tmp_path: Path) -> None:
    file, empty, damaged = (tmp_path / name for name in ("file", "empty", "damaged"))
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    file.write_text("x")
    empty.mkdir()
    damaged.mkdir()
    (damaged / "dataset.json").write_text("{")
    for dataset in (tmp_path / "missing", file, empty, damaged, fifo):
        for command in (["validate"], ["report"], ["split", "--val", "0.5", "--test", "0.1"]):
            ended = invoke(command[0], dataset, *command[1:])
            assert ended.exit_code == 2, (command, dataset, ended.output)
            assert "Error: " in ended.stderr
        ended = invoke("export", "kitti-object", dataset, tmp_path / "out")
        assert ended.exit_code == 2, (dataset, ended.output)


def test_the_command_seldom_looks_for_garbage_while_it_loads() -> None:
    code = (
        "import gc, sys; from carstage.cli import main; sys.argv[1:] = ['--help']\n"
        "try: main()\n"
        "except SystemExit: print('collections', gc.get_stats()[0]['collections'])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60.0
    )
    collections = int(ended.stdout.split()[-1])
    assert collections < 50


def test_nothing_is_looked_through_for_garbage_while_modules_load() -> None:
    frozen = gc.get_freeze_count()
    try:
        with loading():
            assert not gc.isenabled()
            made: list[list[int]] = [[] for _ in range(1000)]
        assert gc.isenabled()
        assert gc.get_freeze_count() > frozen + len(made)
    finally:
        gc.unfreeze()
