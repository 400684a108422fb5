"""Which servers a run begins on, and with which client."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any, ClassVar

import psutil
import pytest

from carstage.config import Config, load_demo
from carstage.errors import BadInputError, ServerError
from carstage.runs import run
from carstage.runs.interruption import Interruption
from carstage.runs.known_verdicts import keep_verdict, known_verdict, verdict_file
from carstage.runs.selftesting import describe_verdict, refuse, run_self_test
from carstage.runs.servers import ServerSetup
from carstage.selftest import Check, Verdict
from carstage.server import ClientPython, Endpoint, RemoteServer, Server, free_port
from running_simulator import RunningSimulator


class Elsewhere(Server):
    """A server that reports a version of our choice."""

    kind: ClassVar[str] = "elsewhere"

    def __init__(self, port: int, version: str) -> None:
        super().__init__()
        self._place = Endpoint("127.0.0.1", port, 8000, version, None)
        self.stopped = False

    def start(self) -> Endpoint:
        self._endpoint = self._place
        return self._place

    def stop(self) -> None:
        self.stopped = True

    def alive(self) -> bool:
        return not self.stopped

    def log_tail(self, lines: int = 20) -> str:
        return ""


def config(*settings: str) -> Config:
    return load_demo(settings)


def remote(server: Server) -> ServerSetup:
    return ServerSetup(config("server={kind: remote}"), lambda config, log_path: server)


@pytest.mark.parametrize(
    ("setting", "must_last"),
    [
        ("conversion.mode=streaming", False),
        ("conversion.mode=deferred", True),
        ("output.keep_raw=true", True),
    ],
)
def test_raw_recordings_must_last_where_they_are_needed_later(
    setting: str, must_last: bool
) -> None:
    assert ServerSetup(config(setting)).raw_must_last is must_last


def test_server_older_than_0_9_13_is_refused_with_both_versions() -> None:
    server = Elsewhere(free_port(), "0.9.12")
    with pytest.raises(BadInputError, match=r"0\.9\.12.*0\.9\.13"), remote(server).facts():
        pytest.fail("it was not refused")
    assert server.stopped


def test_kind_of_sensor_that_a_server_lacks_is_refused_with_both_versions() -> None:
    normals = "rig={sensors: [{id: N, kind: normals, pose: {x: 1.0, z: 2.0}}]}"
    server = Elsewhere(free_port(), "0.9.13")
    setup = ServerSetup(config("server={kind: remote}", normals), lambda config, path: server)
    with pytest.raises(BadInputError, match=r"0\.9\.13.*normals.*0\.9\.14"), setup.facts():
        pytest.fail("it was not refused")
    assert server.stopped


@pytest.mark.end_to_end
def test_newer_server_is_recorded_from_with_the_newest_client(simulator: RunningSimulator) -> None:
    setup = remote(Elsewhere(simulator.port, "0.10.0-ue5"))
    with setup.facts() as facts:
        assert facts.dialect == "0.10.0"
        assert setup.client.client == "0.9.16"
        assert setup.tested


@pytest.mark.parametrize(
    ("settings", "tested", "must_pass"),
    [
        (["server={kind: embedded}"], True, False),
        (["server={kind: embedded, self_test: off}"], False, False),
        (["server={kind: remote}"], True, False),
        (["server={kind: remote, self_test: off}"], False, False),
        (["server={kind: carla, path: somewhere, self_test: require}"], True, True),
    ],
)
def test_servers_are_tested_unless_asked_otherwise(
    settings: list[str], tested: bool, must_pass: bool
) -> None:
    setup = ServerSetup(config(*settings))
    assert (setup.tested, setup.must_pass) == (tested, must_pass)


def verdict(server: str, *checks: Check) -> Verdict:
    return Verdict(server, "0.9.16", "Town10HD", checks)


GOOD = Check("frames", True, "every frame", "every frame")
BAD = Check("LiDAR axes", False, "x forward, y left, z up", "x forward, y right, z up", 0.9)


def test_user_reads_what_failed_and_that_a_server_is_newer() -> None:
    assert list(describe_verdict(verdict("0.9.16", GOOD))) == []
    newer, failed = describe_verdict(verdict("0.10.0", GOOD, BAD))
    assert "0.10.0 is newer than 0.9.16" in newer
    assert "LiDAR axes: x forward, y left, z up" in failed


def test_refusal_of_a_server_that_must_pass_names_what_failed() -> None:
    error = refuse(verdict("0.9.16", GOOD, BAD))
    assert isinstance(error, ServerError)
    assert "LiDAR axes" in error.message
    assert "frames" not in error.message


@pytest.mark.end_to_end
def test_self_test_that_cannot_be_recorded_is_a_failed_verdict(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    python = tmp_path / "python"
    python.write_text('#!/bin/sh\necho \'{"event": "error", "message": "No room."}\'; exit 1\n')
    python.chmod(0o755)
    endpoint = Endpoint("127.0.0.1", simulator.port, free_port(), "0.9.16", None)
    with Interruption() as interruption:
        found = run_self_test(endpoint, ClientPython(python, "0.9.16"), tmp_path, interruption)
    assert found.failed == ("recording",)
    assert "No room." in found.checks[0].found
    assert (tmp_path / "selftest" / "collector.log").exists()  # kept, to look why


@pytest.mark.end_to_end
def test_self_test_does_not_wait_for_a_server_that_has_ended(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    # The client waits for its answer: for a minute, or for as long as nothing says that it is gone.
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\nexec sleep 1000\n")
    python.chmod(0o755)
    endpoint = Endpoint("127.0.0.1", simulator.port, free_port(), "0.9.16", None)
    with Interruption() as interruption:
        found = run_self_test(
            endpoint,
            ClientPython(python, "0.9.16"),
            tmp_path,
            interruption,
            has_ended=lambda: True,
        )
    assert found.failed == ("recording",)
    assert "The server ended" in found.checks[0].found


@pytest.mark.end_to_end
@pytest.mark.xdist_group("runs")
def test_a_server_of_ours_that_ends_during_its_self_test_is_tested_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tested: list[Verdict] = []

    def killing(endpoint: Endpoint, *rest: Any, **options: Any) -> Verdict:
        assert endpoint.pid is not None
        server = psutil.Process(endpoint.pid)
        timer = threading.Timer(0.5, server.kill)  # while the collector is at work
        if not tested:
            timer.start()
        tested.append(run_self_test(endpoint, *rest, **options))
        return tested[-1]

    monkeypatch.setattr("carstage.runs.session.run_self_test", killing)
    short = ("duration_s=0.2", "conversion.workers=1", "image_size=[64, 36]", "server.self_test=on")
    ended = run(config(*short), tmp_path / "out")
    assert ended.state == "done"
    assert [found.ok for found in tested] == [False, True]
    (marker,) = (tmp_path / "out" / "commits").glob("*.json")
    assert json.loads(marker.read_bytes())["self_test"]["ok"]
    assert not (ended.folder / "raw").exists()


@pytest.mark.end_to_end
@pytest.mark.xdist_group("runs")
def test_the_embedded_simulator_is_tested_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tested: list[Verdict] = []

    def counting(*arguments: Any, **options: Any) -> Verdict:
        tested.append(run_self_test(*arguments, **options))
        return tested[-1]

    kept = tmp_path / "verdict.json"
    monkeypatch.setattr("carstage.runs.session.verdict_file", lambda *_: kept)
    monkeypatch.setattr("carstage.runs.session.run_self_test", counting)
    short = ("duration_s=0.2", "conversion.workers=1", "image_size=[64, 36]")
    markers = []
    for name in ("first", "second"):
        assert run(config(*short), tmp_path / name).state == "done"
        (marker,) = (tmp_path / name / "commits").glob("*.json")
        markers.append(json.loads(marker.read_bytes()))
    assert len(tested) == 1
    assert markers[0]["self_test"] == markers[1]["self_test"] == tested[0].to_json()
    assert Verdict.from_json(json.loads(kept.read_bytes())).to_json() == tested[0].to_json()


def test_a_verdict_is_kept_for_one_code_client_and_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = ClientPython(Path("/usr/bin/python3"), "0.9.16")
    usual = verdict_file(config(), client)
    assert usual == verdict_file(config("fps=20"), client)
    assert verdict_file(config("server={kind: remote}"), client) is None
    for word in ("on", "require", "off"):
        assert verdict_file(config(f"server.self_test={word}"), client) is None
    others = [
        verdict_file(config("server.carla_version=0.9.13"), client),
        verdict_file(config(), ClientPython(Path("/opt/python3"), "0.9.16")),
        verdict_file(config(), ClientPython(client.path, "0.9.15")),
    ]
    monkeypatch.setattr("carstage.runs.known_verdicts.code_fingerprint", lambda *_: "edited")
    others.append(verdict_file(config(), client))
    assert None not in others
    assert len({usual, *others}) == 5


def test_only_a_verdict_that_is_whole_and_good_is_taken(tmp_path: Path) -> None:
    file = tmp_path / "cache" / "verdict.json"
    assert known_verdict(None) is None
    assert known_verdict(file) is None
    keep_verdict(file, verdict("0.9.16", GOOD, BAD))
    assert not file.exists()
    keep_verdict(file, verdict("0.9.16", GOOD))
    assert known_verdict(file) == verdict("0.9.16", GOOD)
    bad = verdict("0.9.16", BAD).to_json()
    for text in ("", "[]", "{}", '{"ok": true}', json.dumps(bad)):
        file.write_text(text)
        assert known_verdict(file) is None


def test_run_that_requires_the_self_test_does_not_begin_where_it_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint = Endpoint("127.0.0.1", free_port(), free_port(), "0.9.16", None)
    failed = verdict("0.9.16", GOOD, BAD)
    monkeypatch.setattr(ServerSetup, "warm_up", lambda setup, log_path: endpoint)
    monkeypatch.setattr("carstage.runs.session.run_self_test", lambda *_, **__: failed)
    with pytest.raises(ServerError, match="LiDAR axes"):
        run(config("server.self_test=require", "conversion.workers=1"), tmp_path / "out")
    (status,) = (tmp_path / "out" / "runs").glob("*/status.json")
    assert json.loads(status.read_bytes())["state"] == "failed"
    assert list((tmp_path / "out" / "commits").iterdir()) == []
    (events,) = (tmp_path / "out" / "runs").glob("*/events.jsonl")
    tested = [json.loads(line) for line in events.read_text().splitlines()][1]
    assert (tested["event"], tested["ok"]) == ("server_tested", False)


def test_a_remote_server_is_the_same_again_so_that_it_is_waited_for() -> None:
    made: list[RemoteServer] = []

    def make(config: Config, log_path: Path | None) -> Server:
        made.append(RemoteServer("127.0.0.1", free_port(), timeout_s=0.0))
        return made[-1]

    setup = ServerSetup(config("server={kind: remote}"), make)
    for _ in range(2):
        with pytest.raises(ServerError, match="No CARLA server answers"):
            setup.start(Path("unused.log"))
    assert len(made) == 1
    assert "answer" in setup.start_notice
