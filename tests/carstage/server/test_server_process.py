"""Processes are ended by their own group, all of it, whoever ended first."""

from __future__ import annotations

import inspect
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from carstage.errors import BadInputError, ServerError
from carstage.server import CarlaServer, EmbeddedServer, Server, describe_embedded, probe_version
from carstage.server import description as description_module
from carstage.server.process import ServerProcess

WAIT_S = 60.0

STUBBORN = """
import os, signal, sys, time
if os.fork() == 0:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    print("ready", os.getpid(), flush=True)
    time.sleep(600)
time.sleep(600)
"""
"""A leader that obeys SIGTERM, and a child of its that does not."""


def gone(pid: int) -> bool:
    """Wait for the end of a process that is not our child; a zombie has ended."""
    try:
        process = psutil.Process(pid)
        return process.status() == psutil.STATUS_ZOMBIE or process.wait(WAIT_S) in (None, 0)
    except psutil.NoSuchProcess:
        return True
    except psutil.TimeoutExpired:
        return False


def test_stopping_ends_the_whole_group(tmp_path: Path) -> None:
    process = ServerProcess(
        [sys.executable, "-c", STUBBORN], log_path=tmp_path / "log", marker="ready"
    )
    child = int(process.wait_line(WAIT_S).split()[1])
    process.stop()
    assert process.exit_code == -signal.SIGTERM
    assert gone(child)
    process.stop()  # again: nothing happens


def test_what_a_server_leaves_behind_when_it_dies_is_ended_too(tmp_path: Path) -> None:
    process = ServerProcess(
        [sys.executable, "-c", STUBBORN], log_path=tmp_path / "log", marker="ready"
    )
    child = int(process.wait_line(WAIT_S).split()[1])
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait_end(WAIT_S)
    assert gone(child)
    process.stop()


def test_a_process_that_is_held_still_can_be_ended_at_once(tmp_path: Path) -> None:
    process = ServerProcess(
        [sys.executable, "-c", STUBBORN], log_path=tmp_path / "log", marker="ready"
    )
    child = int(process.wait_line(WAIT_S).split()[1])
    os.kill(process.pid, signal.SIGSTOP)
    process.kill()
    assert process.exit_code == -signal.SIGKILL
    assert gone(child)
    process.stop()


def test_a_process_that_is_held_still_hears_that_it_is_to_end(tmp_path: Path) -> None:
    process = ServerProcess(
        [sys.executable, "-c", "import time; print('ready', flush=True); time.sleep(600)"],
        log_path=tmp_path / "log",
        marker="ready",
    )
    assert process.wait_line(WAIT_S) == "ready"
    os.kill(process.pid, signal.SIGSTOP)
    process.stop()
    assert process.exit_code == -signal.SIGTERM


def test_a_full_disk_does_not_stop_who_writes_the_log() -> None:
    code = "print('x' * 200_000, flush=True); print('ready now', flush=True)"
    process = ServerProcess(
        [sys.executable, "-c", code], log_path=Path("/dev/full"), marker="ready"
    )
    assert process.wait_line(WAIT_S) == "ready now"
    assert process.wait_end(WAIT_S)
    process.stop()


def test_last_words_that_are_still_on_their_way_are_waited_for(tmp_path: Path) -> None:
    words = "print('x' * 80 + '\\n' * 3, flush=True)\n" * 200 + "print('the last\\n\\n')"
    for number in range(5):
        process = ServerProcess(
            [sys.executable, "-c", words], log_path=tmp_path / f"{number}.log", marker="ready"
        )
        try:
            assert process.wait_end(30)
            assert process.tail(1) == "the last"
        finally:
            process.stop()


def test_the_log_takes_both_streams_and_its_tail_is_of_this_process(tmp_path: Path) -> None:
    log = tmp_path / "server.log"
    log.write_text("an earlier server\n")
    code = "import sys; print('to stdout', flush=True); print('to stderr', file=sys.stderr)"
    process = ServerProcess([sys.executable, "-c", code], log_path=log)
    assert process.wait_end(WAIT_S)
    process.stop()
    assert process.exit_code == 0
    assert sorted(process.tail(10).splitlines()) == ["to stderr", "to stdout"]
    assert log.read_text().startswith("an earlier server\n")


def test_a_temporary_log_goes_with_the_process() -> None:
    process = ServerProcess([sys.executable, "-c", ""], log_path=None)
    assert process.wait_end(WAIT_S)
    assert process.log_path.exists()
    process.stop()
    assert not process.log_path.exists()
    assert process.tail(5) == ""


def test_a_leashed_command_does_not_outlive_whoever_started_it(tmp_path: Path) -> None:
    starter = (
        "import subprocess, sys, time\n"
        "command = [sys.executable, '-c', sys.argv[1]]\n"
        "leash = [sys.executable, '-m', 'carstage.server.parent_watch', *command]\n"
        "subprocess.Popen(leash, stdin=subprocess.PIPE)\n"
        "time.sleep(600)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", starter, STUBBORN.replace("SIG_IGN", "SIG_DFL")],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    with process.stdout:
        grandchild = int(process.stdout.readline().split()[1])
        leader = psutil.Process(grandchild).ppid()
        process.kill()
        process.wait()
    assert gone(leader)
    assert gone(grandchild)


def test_a_leash_ends_as_its_command_does() -> None:
    for code, status in (("raise SystemExit(5)", 5), ("import os; os.kill(os.getpid(), 9)", 137)):
        command = [sys.executable, "-m", "carstage.server.parent_watch", sys.executable, "-c", code]
        with subprocess.Popen(command, stdin=subprocess.PIPE) as leash:
            assert leash.wait(WAIT_S) == status


def release(folder: Path, script: str) -> Path:
    path = folder / "CarlaUE4.sh"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return folder


def test_a_folder_without_a_server_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere", Path(sys.executable)):
        with pytest.raises(BadInputError, match=r"server\.path: there is no CARLA server in"):
            CarlaServer(path)


def test_a_release_that_dies_is_said_with_its_last_words(tmp_path: Path) -> None:
    server = CarlaServer(release(tmp_path, "echo no Vulkan driver >&2; exit 3"))
    with pytest.raises(ServerError, match=r"exit status is 3.*\n.*no Vulkan driver") as caught:
        server.start()
    assert "127.0.0.1:" in caught.value.message
    assert not server.alive()


@pytest.mark.parametrize(("end", "code"), [("kill -9 $$", -9), ("exit 255", 255)])
def test_a_signal_that_ended_a_release_is_told_through_its_script(
    tmp_path: Path, end: str, code: int
) -> None:
    server = CarlaServer(release(tmp_path, f"sh -c '{end}'\nexit $?"))
    with pytest.raises(ServerError):
        server.start()
    assert server.exit_code == code


def test_a_release_that_never_answers_is_stopped(tmp_path: Path) -> None:
    server = CarlaServer(release(tmp_path, "exec sleep 600"), timeout_s=0.5)
    with pytest.raises(ServerError, match=r"Waited 0\.5 s"):
        server.start()
    assert not server.alive()


@pytest.mark.end_to_end
@pytest.mark.xdist_group("servers")
def test_a_release_is_started_with_its_own_flags_and_stopped(tmp_path: Path) -> None:
    script = f'echo "$@" > {tmp_path}/arguments\nexec {sys.executable} -m carstage_sim "$@"'
    with CarlaServer(release(tmp_path, script), arguments=["-RenderOffScreen"]) as server:
        port = server.endpoint.port
        assert server.endpoint.version == "0.9.16"
        assert server.alive()
        assert "ready" in server.log_tail()
        leader = server.endpoint.pid
    assert server.exit_code is not None
    assert leader is not None
    assert gone(leader)
    with pytest.raises(ServerError):
        probe_version("127.0.0.1", port)
    arguments = (tmp_path / "arguments").read_text().split()
    assert arguments == [
        *("-RenderOffScreen", "-nosound", f"-carla-rpc-port={port}"),
        *(f"-carla-streaming-port={port + 1}", f"-carla-secondary-port={port + 2}"),
    ]


@pytest.mark.end_to_end
@pytest.mark.xdist_group("servers")
def test_the_embedded_server_is_ready_when_started_and_gone_when_stopped(tmp_path: Path) -> None:
    log = tmp_path / "logs" / "server.log"
    with EmbeddedServer(threads=1, log_path=log, map_name="Stage01") as server:
        endpoint = server.endpoint
        assert probe_version(endpoint.host, endpoint.port) == endpoint.version
        assert endpoint.pid is not None
        assert psutil.Process(endpoint.pid).is_running()
        with pytest.raises(BadInputError, match=rf"server\.port: port {endpoint.port} "):
            EmbeddedServer(port=endpoint.port).start()
    assert (server.alive(), server.exit_code) == (False, 0)
    assert "carstage_sim ready" in log.read_text()


@pytest.mark.end_to_end
@pytest.mark.xdist_group("servers")
def test_an_embedded_server_that_cannot_start_is_said_with_its_last_words() -> None:
    server = EmbeddedServer(map_name="Stage1")
    with pytest.raises(ServerError, match=r"exit status 2.*\n.*did you mean 'Stage01'"):
        server.start()
    assert not server.alive()


def _killed_starter(server: str, *arguments: str) -> int:
    """Kill a process that started a server; the server's process id."""
    code = f"import sys, time\nfrom carstage.server import *\nfrom pathlib import Path\n{server}"
    code += ".start()\nprint(server.endpoint.pid, flush=True)\ntime.sleep(600)\n"
    command = [sys.executable, "-c", code, *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout:
        pid = int(process.stdout.readline())
        process.kill()
        process.wait()
    return pid


@pytest.mark.end_to_end
@pytest.mark.xdist_group("servers")
def test_no_server_outlives_a_starter_that_is_killed(tmp_path: Path) -> None:
    folder = release(tmp_path, f'exec {sys.executable} -m carstage_sim "$@"')
    assert gone(_killed_starter("server = EmbeddedServer(threads=1)\nserver"))
    code = "server = CarlaServer(Path(sys.argv[1]))\nserver"
    assert gone(_killed_starter(code, str(folder)))


@pytest.fixture
def fresh_descriptions() -> Callable[[], None]:
    describe_embedded.cache_clear()
    return describe_embedded.cache_clear


def test_the_simulator_describes_itself_once(
    tmp_path: Path, fresh_descriptions: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = describe_embedded(tmp_path)
    assert first.maps["Stage01"] > 0
    assert first.blueprints["sensor.camera.rgb"].attributes["fov"] == "90.0"
    assert "vehicle.tesla.model3" in first.blueprints
    fresh_descriptions()
    monkeypatch.setattr(description_module, "_ask", lambda: pytest.fail("asked again"))
    assert describe_embedded(tmp_path) == first
    old = describe_embedded(tmp_path, "0.9.13")  # the same answer tells of every version
    assert old.protocol == "0.9.13"
    assert set(first.blueprints) - set(old.blueprints) >= {"sensor.camera.normals"}


def test_a_damaged_description_is_asked_for_again(
    tmp_path: Path, fresh_descriptions: Callable[[], None]
) -> None:
    first = describe_embedded(tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text()[:100])
    fresh_descriptions()
    assert describe_embedded(tmp_path) == first


def test_every_server_says_its_kind() -> None:
    kinds, classes = set(), [Server]
    while classes:
        server = classes.pop()
        classes += server.__subclasses__()
        if not inspect.isabstract(server) and server.__module__.startswith("carstage."):
            kinds.add(server.kind)
    assert kinds == {"embedded", "carla", "remote"}
