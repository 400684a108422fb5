"""Runs over the wire: queue, start, adopt, stop; a fake process stands in for the recorder."""

import errno
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from carstage.config import check_config, dump_config
from carstage.runs.folder import new_run_id
from carstage.runs.server_lock import server_key
from carstage.storage import CommitMarker
from carstage.web.messages import RunSummary
from carstage.web.runs import launches
from carstage.web.runs.launches import Launch, Launches
from sites import FakeRun, Site, open_site
from waiting import await_that

LIVE = "ws://127.0.0.1:8321/api/live"

RECORDER = """
import json, os, pathlib, signal, sys, time
from carstage.runs.identity import identify
out, run_id = pathlib.Path(sys.argv[1]), sys.argv[2]
stops = []
signal.signal(signal.SIGINT, lambda *_: stops.append(1))
folder = out / "runs" / run_id
(out / "commits").mkdir(parents=True, exist_ok=True)
(out / "dataset.json").write_text('{"format_version": 1, "name": "fake", "tags": []}')
folder.mkdir(parents=True)
def say(state):
    status = {"format_version": 1, "run_id": run_id, "state": state, **identify(),
              "heartbeat": time.time(),
              "episodes": {"total": 1, "committed": 0, "failed": 0, "skipped": 0},
              "current": None, "message": None}
    (folder / ".s").write_text(json.dumps(status))
    (folder / ".s").replace(folder / "status.json")
say("recording")
while not stops:
    time.sleep(0.02)
say("interrupted")
"""


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    """The processes that a test has started; ended after it."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def queueing(
    tmp_path: Path, started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> Iterator[TestClient]:
    """A site whose runs are fakes that go on until they are asked to stop."""

    def start(config: Path, out: Path, run_id: str, log: Path, **_: Any) -> Any:
        assert json.loads(config.read_bytes())["name"]
        command = [sys.executable, "-c", RECORDER, str(out), run_id]
        with log.open("ab") as output:
            child = subprocess.Popen(command, stdout=output, stderr=output)
        started.append(child)
        return child

    monkeypatch.setattr("carstage.runs.launching.launch", start)
    with open_site(tmp_path) as client:
        yield client


def runs(client: TestClient) -> list[RunSummary]:
    return [RunSummary.model_validate(run) for run in client.get("/api/runs").json()["runs"]]


def states(client: TestClient) -> dict[str, str]:
    return {run.run_id: f"{run.state}/{run.alive}" for run in runs(client)}


def begin(client: TestClient, config: dict[str, Any], dataset: str) -> str:
    answer = client.post("/api/runs", json={"dataset": dataset, "config": config})
    assert answer.status_code == 201, answer.text
    run_id: str = answer.json()["run_id"]
    return run_id


def test_runs_of_one_server_wait_for_each_other(queueing: TestClient, demo: dict[str, Any]) -> None:
    first, second, third = (begin(queueing, demo, name) for name in ("a", "b", "c"))
    await_that(lambda: states(queueing)[first] == "recording/running")
    waiting = {run.run_id: run.position for run in runs(queueing)}
    assert (waiting[first], waiting[second], waiting[third]) == (0, 1, 2)
    assert queueing.post(f"/api/runs/{second}/stop").json()["alive"] == "ended"
    assert second not in states(queueing)
    assert queueing.post(f"/api/runs/{first}/stop").json()["stop"] == 1
    await_that(lambda: states(queueing)[first] == "interrupted/ended")
    await_that(lambda: states(queueing)[third] == "recording/running")
    again = queueing.post(f"/api/runs/{first}/stop")
    assert again.status_code == 409


def test_another_server_need_not_wait(queueing: TestClient, demo: dict[str, Any]) -> None:
    first = begin(queueing, demo, "a")
    second = begin(queueing, {**demo, "server": {"kind": "remote", "port": 2100}}, "b")
    assert states(queueing)[second] != "queued/queued"
    await_that(lambda: set(states(queueing).values()) == {"recording/running"})
    assert {first, second} == set(states(queueing))


def test_a_new_server_adopts_runs_and_queue_of_one_that_was_killed(
    queueing: TestClient, tmp_path: Path, demo: dict[str, Any]
) -> None:
    first, second = begin(queueing, demo, "a"), begin(queueing, demo, "b")
    await_that(lambda: states(queueing)[first] == "recording/running")
    with open_site(tmp_path) as another:
        assert states(another) == {first: "recording/running", second: "queued/queued"}
        another.post(f"/api/runs/{first}/stop")
        await_that(lambda: states(another)[first] == "interrupted/ended")
        await_that(lambda: states(another)[second] == "recording/running")


def test_starting_freezes_the_configuration(queueing: TestClient, demo: dict[str, Any]) -> None:
    state = queueing.get("/api/config").json()
    stale = queueing.post("/api/runs", json={"dataset": "a", "rev": state["rev"] + 1})
    assert stale.status_code == 409
    run_id = queueing.post("/api/runs", json={"dataset": "a", "rev": state["rev"]}).json()["run_id"]
    change = {"rev": state["rev"], "config": {**demo, "name": "changed"}}
    assert queueing.put("/api/config", json=change).status_code == 200
    assert queueing.get(f"/api/runs/{run_id}").status_code == 200
    frozen = Launches(Path(tmp_of(queueing)) / "launches", Path()).config(run_id)
    assert frozen["name"] == "demo"


def tmp_of(client: TestClient) -> Path:
    launches: Any = client.app.state.services.runs  # type: ignore[attr-defined]
    folder: Path = launches._launches._folder.parent
    return folder


def test_wrong_configurations_are_not_started(site: Site, demo: dict[str, Any]) -> None:
    answer = site.client.post("/api/runs", json={"dataset": "x", "config": {**demo, "fps": 0}})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["path"] == ["fps"]
    assert not (site.root / "x").exists()


def test_other_settings_do_not_go_into_a_dataset_unasked(
    queueing: TestClient, tmp_path: Path, demo: dict[str, Any]
) -> None:
    run_id = begin(queueing, demo, "a")
    await_that(lambda: states(queueing)[run_id] == "recording/running")
    out = next(tmp_path.glob(f"**/runs/{run_id}")).parents[1]
    marker = CommitMarker("e1", "a1", 1, (), {})
    (out / "commits").mkdir(exist_ok=True)
    (out / "commits" / "e1.json").write_bytes(marker.to_bytes())
    config = dump_config(check_config({**demo, "fps": 20}))
    plan = {"config": config, "episodes": [{"episode_id": "e1"}]}
    (out / "runs" / run_id / "plan.json").write_text(json.dumps(plan))
    refused = queueing.post("/api/runs", json={"dataset": "a", "config": demo})
    assert (refused.status_code, refused.json()["code"]) == (409, "other_settings")
    assert "fps is 10.0, was 20.0" in refused.json()["message"]
    wanted = {"dataset": "a", "config": demo, "append": True}
    assert queueing.post("/api/runs", json=wanted).status_code == 201


def test_a_command_that_is_refused_says_why(
    tmp_path: Path, demo: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(config: Path, out: Path, run_id: str, log: Path, **_: Any) -> Any:
        del config, out, run_id
        words = (
            "import sys; sys.exit('some line\\nError: server.host: nobody is there.\\nStart it.')"
        )
        with log.open("ab") as output:
            return subprocess.Popen([sys.executable, "-c", words], stderr=output)

    monkeypatch.setattr("carstage.runs.launching.launch", start)
    with open_site(tmp_path) as client:
        run_id = begin(client, demo, "a")
        await_that(lambda: states(client)[run_id] == "failed/ended")
        assert runs(client)[0].message == "Host: nobody is there. Start it."


def test_runs_that_others_have_started_are_shown_and_stopped(
    tmp_path: Path, fake_run: FakeRun
) -> None:
    with open_site(tmp_path / "datasets") as client:
        (run,) = runs(client)
        assert (run.state, run.alive, run.dataset) == ("recording", "running", "drives")
        assert run.progress == pytest.approx((20 + 5) / 40)
        assert [sensor.id for sensor in run.sensors] == ["CAM", "IMU", "TOP"]
        assert client.post(f"/api/runs/{run.run_id}/stop").status_code == 200
        assert fake_run.process.wait(10) != 0
        await_that(lambda: runs(client)[0].alive == "dead")
        assert client.post(f"/api/runs/{run.run_id}/stop").status_code == 409


def test_a_press_of_who_has_not_seen_the_one_before_ends_no_run_at_once(
    tmp_path: Path, demo: dict[str, Any], queueing: TestClient, started: list[Any]
) -> None:
    asked = FakeRun(tmp_path / "other", "20260101-000000-abcdef", demo)
    own = begin(queueing, {**demo, "server": {"kind": "remote", "port": 2100}}, "a")
    await_that(lambda: states(queueing)[own] == "recording/running")
    signals: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("carstage.runs.launching.os.kill", lambda pid, _: signals.append(pid))
        for run_id, pid in ((own, started[0].pid), (asked.folder.name, asked.process.pid)):
            signals.clear()
            for seen, stop, sent in ((0, 1, 1), (0, 1, 1), (1, 2, 2), (1, 2, 2)):
                answer = queueing.post(f"/api/runs/{run_id}/stop", json={"seen": seen})
                assert answer.json()["stop"] == stop
                assert signals == [pid] * sent
            (run,) = (run for run in runs(queueing) if run.run_id == run_id)
            assert run.stop == 2
    asked.end()


def test_a_run_that_says_nothing_is_stalled_and_one_without_process_dead(
    tmp_path: Path, fake_run: FakeRun
) -> None:
    with open_site(tmp_path / "datasets") as client:
        fake_run.say(heartbeat=time.time() - 120)
        assert runs(client)[0].alive == "stalled"
        fake_run.say(heartbeat=time.time())
        assert runs(client)[0].alive == "running"
        fake_run.say(heartbeat=time.time() - 120, pid_start_ticks=1)
        assert runs(client)[0].alive == "dead"  # its number is another process's now
        fake_run.say(state="done")
        assert runs(client)[0].alive == "ended"


def test_every_browser_hears_of_runs_logs_and_ticks(tmp_path: Path, fake_run: FakeRun) -> None:
    fake_run.event("tick", tick=0, queued_bytes=0, waited_s=0.0)
    with (
        open_site(tmp_path / "datasets") as client,
        client.websocket_connect(LIVE) as one,
        client.websocket_connect(LIVE) as two,
    ):
        snapshot = one.receive_json()
        assert snapshot["run"]["run"]["run_id"] == fake_run.folder.name
        assert two.receive_json()["type"] == "snapshot"
        one.send_json({"type": "watch", "run_id": fake_run.folder.name})
        log = heard(one, "log")
        assert log["reset"]
        assert [line["event"] for line in log["lines"]] == ["run_started"]
        assert heard(one, "ticks")["reset"]
        channels = heard(one, "channels")["channels"]
        assert [(c["sensor_id"], c["kind"]) for c in channels] == [
            ("CAM", "image"),
            ("TOP", "points"),
        ]
        fake_run.event("episode_failed", episode_id="e2", reason="it broke")
        more = heard(one, "log")
        assert not more["reset"]
        assert more["lines"][0]["level"] == "error"
        fake_run.say(state="failed", message="it broke")
        for socket in (one, two):
            assert heard(socket, "run", state="failed")["run"]["message"] == "it broke"


def heard(socket: Any, kind: str, **run: Any) -> dict[str, Any]:
    """The next message of a kind; of a run, in a state."""
    for _ in range(200):
        message: dict[str, Any] = socket.receive_json()
        if message["type"] == kind and run.items() <= message.get("run", {}).items():
            return message
    raise AssertionError(f"no {kind}")


def test_changes_of_the_configuration_reach_everybody(tmp_path: Path) -> None:
    with open_site(tmp_path) as client, client.websocket_connect(LIVE) as socket:
        state = socket.receive_json()["config"]
        change = {"rev": 0, "config": {**state["config"], "name": "other"}, "author": "me"}
        assert client.put("/api/config", json=change).status_code == 200
        told = heard(socket, "config")["config"]
        assert (told["rev"], told["author"], told["config"]["name"]) == (1, "me", "other")
    with open_site(tmp_path) as client:  # a new server knows it
        assert client.get("/api/config").json()["config"]["name"] == "other"


def test_a_change_while_a_page_connects_reaches_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_site(tmp_path) as client:
        state = client.get("/api/config").json()
        change = {"rev": 0, "config": {**state["config"], "name": "other"}, "author": "me"}
        services: Any = client.app.state.services  # type: ignore[attr-defined]
        listed = services.jobs.all

        def all_jobs() -> Any:  # the snapshot has taken the configuration before
            monkeypatch.undo()
            assert client.put("/api/config", json=change).status_code == 200
            return listed()

        hub = services.live
        snapshot = hub._snapshot

        def made() -> Any:
            monkeypatch.setattr(services.jobs, "all", all_jobs)
            return snapshot()

        monkeypatch.setattr(hub, "_snapshot", made)
        with client.websocket_connect(LIVE) as socket:
            told = socket.receive_json()["config"]
            assert (told["rev"], told["config"]["name"]) == (1, "other")


def test_servers_are_told_apart_by_address() -> None:
    def key(**server: Any) -> str:
        return server_key(check_config({"server": server}))

    assert key(kind="embedded") == key(kind="carla", path="/x")
    assert key(kind="remote", host="localhost", port=2000) == key(kind="remote", port=2000)
    assert key(kind="remote", port=2000) != key(kind="remote", port=2002)
    assert key(kind="carla", path="/x", port=2000) == key(kind="remote", port=2000)


def test_run_ids_are_names_of_folders() -> None:
    assert new_run_id() != new_run_id()
    assert new_run_id().replace("-", "").isalnum()


def test_a_run_is_begun_once_even_if_that_cannot_be_written_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[subprocess.Popen[bytes]] = []

    def start(*_: object, **__: object) -> subprocess.Popen[bytes]:
        begun.append(subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE))
        return begun[-1]

    queue = Launches(tmp_path / "launches", tmp_path, start)
    queue.queue(Launch("r", str(tmp_path / "out"), "r", "", 1.0, 0), {})
    whole = launches.write_whole

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(launches, "write_whole", full)
    with pytest.raises(OSError, match="space"):
        queue.begin("r")
    monkeypatch.setattr(launches, "write_whole", whole)
    (launch,) = queue.all()
    assert not launch.queued
    begun[0].communicate(b"\n")
    await_that(lambda: queue.all()[0].ended is not None)
    assert len(begun) == 1
