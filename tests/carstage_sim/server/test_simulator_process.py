"""The server as a process: its options, its ready line, its end."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from carstage_sim.cli import parse_options
from carstage_sim.render.quality import Quality
from running_simulator import start_simulator, stop_simulator


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "carstage_sim", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_ends_a_ready_server_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "log"
    simulator = start_simulator(log)
    simulator.process.send_signal(number)
    assert simulator.process.wait(10.0) == 0
    assert stop_simulator(simulator) == 0
    assert log.read_text() == ""


def test_killed_launcher_leaves_no_server(tmp_path: Path) -> None:
    launcher = textwrap.dedent(
        """
        import subprocess, sys
        command = [sys.executable, "-m", "carstage_sim", "--port", "0", "--exit-with-parent"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        print(server.stdout.readline(), end="", flush=True)
        sys.stdin.read()
        """
    )
    process = subprocess.Popen(
        [sys.executable, "-c", launcher],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    server_pid = int(process.stdout.readline().rsplit("pid=", 1)[1])
    server = os.pidfd_open(server_pid)
    try:
        process.kill()
        process.communicate()
        ended, _, _ = select.select([server], [], [], 10.0)
        if not ended:
            os.kill(server_pid, signal.SIGKILL)
    finally:
        os.close(server)
    assert ended, "the server outlived its launcher"


def test_launcher_that_was_gone_before_the_server_could_look_leaves_none() -> None:
    gone = 2**22 + 1  # above the kernel's largest pid
    result = run("--port", "0", "--threads", "1", "--exit-with-parent", str(gone))
    assert result.returncode == 0, result.stderr


def test_port_in_use_is_refused_with_a_way_out() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        result = run("--port", str(port))
    assert result.returncode == 2
    assert f"port {port} on 127.0.0.1 is in use" in result.stderr
    assert "--port" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_unknown_map_is_refused_with_the_nearest_one() -> None:
    result = run("--port", "0", "--map", "Stage1")
    assert result.returncode == 2
    assert "Stage01" in result.stderr


def test_describe_lists_maps_and_blueprints_as_json() -> None:
    result = run("--describe")
    assert result.returncode == 0
    document = json.loads(result.stdout)
    maps = {entry["name"]: entry["spawn_points"] for entry in document["maps"]}
    assert maps["Stage01"] > 50
    blueprints = {entry["id"]: entry for entry in document["blueprints"]}
    fov = next(
        attribute
        for attribute in blueprints["sensor.camera.rgb"]["attributes"]
        if attribute["id"] == "fov"
    )
    assert fov["type"] == "float"
    assert fov["default"] == "90.0"
    assert document["protocol"] in document["protocols"]


def test_spelling_of_the_start_script_is_understood() -> None:
    options = parse_options(
        [
            "-carla-rpc-port=3000",
            "-carla-streaming-port=4000",
            "-RenderOffScreen",
            "-quality-level=Low",
            "-nosound",
            "-carla-server",
            "-benchmark",
            "-fps=20",
            "--map=/Game/Carla/Maps/Stage01",
        ]
    )
    assert (options.port, options.streaming_port) == (3000, 4000)
    assert options.frames_per_s == 20.0
    assert options.map_name == "Stage01"


def test_what_others_start_carla_with_is_understood() -> None:
    options = parse_options(
        ["Town03", "-carla-world-port=8010", "-quality_level=Epic", "-resx=800", "-RESY=600"]
    )
    assert (options.map_name, options.port, options.streaming_port) == ("Town03", 8010, 8011)
    assert options.quality is Quality.EPIC
    assert parse_options(["/Game/Carla/Maps/Town01", "-nosound"]).map_name == "Town01"
    apart = parse_options(["-windowed", "-ResX=", "800", "-ResY=", "600", "-carla-rpc-port=8010"])
    assert (apart.map_name, apart.port) == ("Stage01", 8010)
    assert parse_options(["Town01", "--map", "Town02"]).map_name == "Town02"
    assert parse_options([]).map_name == "Stage01"


@pytest.mark.parametrize(
    ("given", "nearest"),
    [
        ("-RenderOfScreen", "-RenderOffScreen"),
        ("--thread=2", "--threads"),
        ("-carla-rpcport=2000", "-carla-rpc-port"),
    ],
)
def test_unknown_option_is_refused_with_the_nearest_one(
    capsys: pytest.CaptureFixture[str], given: str, nearest: str
) -> None:
    with pytest.raises(SystemExit) as refusal:
        parse_options([given])
    assert refusal.value.code == 2
    assert f"did you mean {nearest}?" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--port=70000"], ["--port=65535"], ["--threads=0"], ["--fps=0"]]
)
def test_impossible_number_is_refused(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as refusal:
        parse_options(arguments)
    assert refusal.value.code == 2


@pytest.mark.parametrize("spelling", ["--quality=epic", "-quality-level=Epic"])
def test_quality_is_understood_in_both_spellings(spelling: str) -> None:
    assert parse_options([]).quality is Quality.LOW
    assert parse_options([spelling]).quality is Quality.EPIC


def test_an_unknown_quality_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse_options(["--quality", "ultra"])
    assert "'ultra' is not low or epic" in capsys.readouterr().err
