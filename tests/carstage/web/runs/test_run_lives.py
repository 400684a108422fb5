"""What becomes of runs: the interface says of each exactly what its folder says.

Fake recorders stand in for ``carstage run``: they write folders as it does, and end as told.
"""

from __future__ import annotations

import io
import json
import random
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from carstage.runs.identity import is_alive
from carstage.runs.launching import RunOptions
from carstage.web.messages import RunSummary
from sites import FakeRun, open_site
from waiting import await_that

FINAL = {"done", "failed", "interrupted"}

RECORDER = """
import json, pathlib, signal, sys, time
from carstage.runs.identity import identify
out, run_id, name = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
told = []
signal.signal(signal.SIGINT, lambda *_: told.append("interrupted"))
folder = out / "runs" / run_id
(out / "commits").mkdir(parents=True, exist_ok=True)
(out / "dataset.json").write_text('{"format_version": 1, "name": "fake", "tags": []}')
folder.mkdir(parents=True)
order = out.parent / "orders" / run_id
def say(state, committed=0, failed=0, message=None):
    status = {"format_version": 1, "run_id": run_id, "state": state, **identify(),
              "heartbeat": time.time(),
              "episodes": {"total": 2, "committed": committed, "failed": failed, "skipped": 0},
              "current": None, "message": message}
    (folder / ".s").write_text(json.dumps(status))
    (folder / ".s").replace(folder / "status.json")
(folder / "plan.json").write_text(json.dumps(
    {"format_version": 1, "run_id": run_id, "config": {"name": name}, "episodes": []}))
say("recording")
while not told and not order.exists():
    time.sleep(0.01)
end = told[0] if told else order.read_text()
if end == "failed":
    say("failed", 1, 1, "Episode e2 failed: it broke.")
    sys.exit(1)
say(end, 2 if end == "done" else 1)
"""


class Recorders:
    """Starts fake recorders, tells them how to end, and sees that none outlives its test."""

    def __init__(self, folder: Path) -> None:
        self.orders = folder / "orders"
        self.orders.mkdir()
        self.children: dict[str, subprocess.Popen[bytes]] = {}
        self.options: dict[str, RunOptions] = {}
        self.refuse = False

    def start(
        self, config: Path, out: str, run_id: str, log: Path, *, options: RunOptions, folder: Path
    ) -> subprocess.Popen[bytes]:
        del folder
        name = json.loads(config.read_bytes())["name"]
        command = [sys.executable, "-c", RECORDER, out, run_id, name]
        if self.refuse:
            command = [sys.executable, "-c", "import sys; sys.exit('Error: no such map. Choose.')"]
        with log.open("ab") as output:
            child = subprocess.Popen(command, stdout=output, stderr=output)
        self.children[run_id], self.options[run_id] = child, options
        return child

    def end(self, run_id: str, how: str) -> None:
        if how == "killed":
            self.children[run_id].kill()
        else:
            part = self.orders / f".{run_id}"
            part.write_text(how)
            part.replace(self.orders / run_id)


@pytest.fixture
def recorders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Recorders]:
    made = Recorders(tmp_path)
    monkeypatch.setattr("carstage.runs.launching.launch", made.start)
    yield made
    for child in made.children.values():
        child.kill()
        child.wait()


@pytest.fixture
def client(tmp_path: Path, recorders: Recorders) -> Iterator[TestClient]:
    del recorders
    with open_site(tmp_path) as made:
        yield made


def runs(client: TestClient) -> dict[str, RunSummary]:
    listed = client.get("/api/runs").json()["runs"]
    return {run["run_id"]: RunSummary.model_validate(run) for run in listed}


def begin(client: TestClient, demo: dict[str, Any], dataset: str, **more: Any) -> str:
    answer = client.post("/api/runs", json={"dataset": dataset, "config": demo, **more})
    assert answer.status_code == 201, answer.text
    run_id: str = answer.json()["run_id"]
    return run_id


def again(client: TestClient, run_id: str, **body: Any) -> str:
    answer = client.post(f"/api/runs/{run_id}/again", json=body)
    assert answer.status_code == 201, answer.text
    made: str = answer.json()["run_id"]
    return made


def recording(client: TestClient, run_id: str) -> Callable[[], bool]:
    return lambda: (
        (runs(client)[run_id].state, runs(client)[run_id].alive)
        == (
            "recording",
            "running",
        )
    )


def over(client: TestClient, run_id: str) -> Callable[[], bool]:
    return lambda: runs(client)[run_id].alive in ("ended", "dead")


def disagreements(client: TestClient, root: Path) -> list[str]:
    """Where the interface says something else than the folders of the runs."""
    shown = runs(client)
    folders = {path.parent.name: path.parent for path in root.glob("*/runs/*/status.json")}
    wrong = [f"{run_id} is not shown" for run_id in folders.keys() - shown.keys()]
    for run_id, run in shown.items():
        if run_id not in folders:
            if run.alive not in ("queued", "running", "ended"):
                wrong.append(f"{run_id} without a folder is {run.alive}")
            continue
        status = json.loads((folders[run_id] / "status.json").read_bytes())
        alive = "ended" if status["state"] in FINAL else "running" if is_alive(status) else "dead"
        told = (run.state, run.alive, run.message, run.episodes.model_dump())
        written = (status["state"], alive, status["message"], status["episodes"])
        if told != written:
            wrong.append(f"{run_id}: {told} is shown, {written} is written")
        finished = alive in ("ended", "dead")
        if (run.ended is not None) != finished:
            wrong.append(f"{run_id}: ended {run.ended}, {alive}")
        if run.ended is not None and run.ended != status["heartbeat"]:
            wrong.append(f"{run_id}: ended at another time than its last word")
        missing = status["state"] != "done" or status["episodes"]["failed"] > 0
        if run.resumable != (finished and missing):
            wrong.append(f"{run_id}: resumable {run.resumable}")
    positions = [run.position for run in shown.values() if run.alive == "queued"]
    if positions != list(range(1, len(positions) + 1)):
        wrong.append(f"places in the queue: {positions}")
    return wrong


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_lives_are_shown_as_the_folders_have_them(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any], seed: int
) -> None:
    chance = random.Random(seed)
    gone: set[str] = set()

    def settle() -> None:
        await_that(lambda: disagreements(client, tmp_path) == [])
        assert not gone & runs(client).keys()

    for step in range(16):
        shown = runs(client)
        going = [one for one in shown.values() if one.alive == "running"]
        ended = [one for one in shown.values() if one.alive in ("ended", "dead")]
        do = chance.choice(["start", "end", "end", "resume", "duplicate", "delete", "take out"])
        if do == "start" or not shown:
            begin(client, {**demo, "name": f"run {step}"}, chance.choice("ab"))
        elif do == "end" and going:
            run_id = going[0].run_id
            await_that(recording(client, run_id))
            how = chance.choice(["done", "failed", "killed", "stop"])
            if how == "stop":
                assert client.post(f"/api/runs/{run_id}/stop").status_code == 200
            else:
                recorders.end(run_id, how)
            await_that(over(client, run_id))
        elif do == "resume" and ended:
            run = chance.choice(ended)
            answer = client.post(f"/api/runs/{run.run_id}/again", json={})
            assert answer.status_code == (201 if run.resumable else 409), answer.text
            if run.resumable:
                assert answer.json()["continues"] == run.run_id
                assert answer.json()["location"] == run.location
        elif do == "duplicate" and ended:
            again(client, chance.choice(ended).run_id, dataset=f"copy-{step}")
        elif do == "delete" and ended:
            run_id = chance.choice(ended).run_id
            assert client.delete(f"/api/runs/{run_id}").status_code == 204
            gone.add(run_id)
        elif do == "take out":
            waiting = [one for one in shown.values() if one.alive == "queued"]
            if waiting:
                run_id = chance.choice(waiting).run_id
                assert client.post(f"/api/runs/{run_id}/stop").status_code == 200
                gone.add(run_id)
        settle()
    with open_site(tmp_path) as another:  # a new server says the same
        await_that(lambda: disagreements(another, tmp_path) == [])


def test_a_stopped_run_goes_on_with_its_settings_and_options(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    first = begin(client, demo, "a", workers="auto", retries=5, work=str(tmp_path / "scratch"))
    assert recorders.options[first].workers == "auto"
    recorders.end(first, "interrupted")
    children = recorders.children
    await_that(lambda: children[first].poll() is not None)
    await_that(over(client, first))
    second = again(client, first)
    assert recorders.options[second] == recorders.options[first]
    assert recorders.options[second].arguments() == [
        *("--retries", "5", "--workers", "auto", "--work", str(tmp_path / "scratch"))
    ]
    assert runs(client)[second].continues == first
    recorders.end(second, "done")
    await_that(over(client, second))
    nothing = client.post(f"/api/runs/{second}/again", json={})
    assert (nothing.status_code, "everything" in nothing.json()["message"]) == (409, True)


def test_a_run_of_somebody_else_goes_on_too(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    run = FakeRun(tmp_path / "drives", "20260101-000000-abcdef", demo)
    refused = client.post(f"/api/runs/{run.folder.name}/again", json={})
    assert (refused.status_code, refused.json()["message"]) == (409, "The run goes on.")
    run.end()
    run.say(state="failed", message="it broke")
    await_that(over(client, run.folder.name))
    second = again(client, run.folder.name)
    assert runs(client)[second].location == str(tmp_path / "drives")
    assert recorders.options[second] == RunOptions()


@pytest.mark.parametrize("damage", ['{"config": []}', "[" * 100_000, '{"episodes": 7}', "{"])
def test_a_damaged_plan_of_a_stranger_stops_no_other_run(
    client: TestClient, tmp_path: Path, demo: dict[str, Any], damage: str
) -> None:
    foreign = FakeRun(tmp_path / "drives", "20260101-000000-abcdef", demo)
    own = FakeRun(tmp_path / "drives", "20260102-000000-abcdef", demo)
    (foreign.folder / "plan.json").write_text(damage)
    for run in (foreign, own):
        run.end()
        run.say(state="failed", message="it broke")
    await_that(lambda: {foreign.folder.name, own.folder.name} <= runs(client).keys())


def test_a_share_of_a_campaign_is_gone_on_with_at_the_command_line(
    client: TestClient, tmp_path: Path, demo: dict[str, Any]
) -> None:
    run = FakeRun(tmp_path / "drives", "20260101-000000-abcdef", demo)
    plan = run.folder / "plan.json"
    plan.write_text(json.dumps({**json.loads(plan.read_bytes()), "shard": "2/8"}))
    await_that(lambda: run.folder.name in runs(client))
    run.end()
    run.say(state="failed", message="it broke")
    await_that(over(client, run.folder.name))
    refused = client.post(f"/api/runs/{run.folder.name}/again", json={})
    assert (refused.status_code, "2/8" in refused.json()["message"]) == (409, True)


def test_runs_are_renamed_and_removed(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    run_id = begin(client, demo, "a")
    await_that(recording(client, run_id))
    assert client.delete(f"/api/runs/{run_id}").status_code == 409
    assert client.patch(f"/api/runs/{run_id}", json={"name": "Rain"}).json()["name"] == "Rain"
    recorders.end(run_id, "done")
    await_that(over(client, run_id))
    assert client.patch(f"/api/runs/{run_id}", json={"name": " Fog "}).json()["name"] == "Fog"
    for name in ("", " ", "a\nb", "x" * 101):
        answer = client.patch(f"/api/runs/{run_id}", json={"name": name})
        assert answer.status_code in (400, 422), name
    with open_site(tmp_path) as another:
        assert runs(another)[run_id].name == "Fog"
    files = client.get(f"/api/runs/{run_id}/files.zip")
    names = zipfile.ZipFile(io.BytesIO(files.content)).namelist()
    assert f"run-{run_id}/status.json" in names
    assert client.delete(f"/api/runs/{run_id}").status_code == 204
    assert run_id not in runs(client)
    assert not (tmp_path / "a" / "runs" / run_id).exists()
    assert (tmp_path / "a" / "dataset.json").exists()
    assert client.get(f"/api/runs/{run_id}").status_code == 404


def test_a_run_that_was_refused_has_ended_and_says_why(
    client: TestClient, recorders: Recorders, demo: dict[str, Any]
) -> None:
    recorders.refuse = True
    run_id = begin(client, demo, "a")
    await_that(over(client, run_id))
    run = runs(client)[run_id]
    assert run.ended is not None
    assert run.started is not None
    assert run.ended >= run.started
    detail = client.get(f"/api/runs/{run_id}").json()
    assert [line["level"] for line in detail["log"]] == ["error"]
    assert detail["log"][0]["text"] == "no such map. Choose."
    assert run.resumable


def test_the_progress_of_a_run_never_goes_back(tmp_path: Path, fake_run: FakeRun) -> None:
    current = dict(fake_run._status["current"])
    with open_site(tmp_path / "datasets") as client:
        run_id = fake_run.folder.name
        fake_run.say(current={**current, "ticks_done": 10, "frames_converted": 9})
        before = runs(client)[run_id].progress
        fake_run.say(current=None)  # it is being committed
        assert runs(client)[run_id].progress == before
        fake_run.say(current=None, episodes={"total": 2, "committed": 2, "failed": 0, "skipped": 0})
        assert runs(client)[run_id].progress > before


def test_a_second_attempt_is_told_with_its_reason(tmp_path: Path, fake_run: FakeRun) -> None:
    with open_site(tmp_path / "datasets") as client:
        assert runs(client)[fake_run.folder.name].again is None
        fake_run.event("episode_retried", episode_id="e2", reason="The server ended.")
        assert runs(client)[fake_run.folder.name].again == "The server ended."


def test_a_run_knows_which_episodes_are_its_own(tmp_path: Path, fake_run: FakeRun) -> None:
    with open_site(tmp_path / "datasets") as client:
        detail = f"/api/runs/{fake_run.folder.name}"
        assert client.get(detail).json()["committed"] == []
        fake_run.event("episode_skipped", episode_id="e1", reason="it is there")
        fake_run.event("episode_committed", episode_id="e2")
        answer = client.get(detail).json()
        assert answer["committed"] == ["e2"]
        assert answer["bytes"] > 0


def done_run(client: TestClient, recorders: Recorders, config: dict[str, Any], into: str) -> str:
    run_id = begin(client, config, into)
    await_that(recording(client, run_id))
    recorders.end(run_id, "done")
    await_that(over(client, run_id))
    return run_id


def test_a_run_whose_dataset_is_moved_away_is_not_told_to_have_failed(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    run_id = done_run(client, recorders, demo, "a")
    (tmp_path / "a").rename(tmp_path / ".away")
    await_that(lambda: run_id not in runs(client))
    with open_site(tmp_path) as another:
        assert run_id not in runs(another)
        (tmp_path / ".away").rename(tmp_path / "b")
        await_that(lambda: run_id in runs(another))
        moved = runs(another)[run_id]
        assert (moved.state, moved.dataset, moved.resumable) == ("done", "b", False)
    recorders.refuse = True
    refused = begin(client, demo, "a")
    await_that(over(client, refused))
    assert (runs(client)[refused].state, runs(client)[refused].resumable) == ("failed", True)


def test_a_removed_dataset_takes_the_launches_of_runs_that_are_gone_with_it(
    client: TestClient, recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    first = done_run(client, recorders, demo, "a")
    (tmp_path / "a" / "runs" / first).rename(tmp_path / ".away")
    second = done_run(client, recorders, demo, "a")
    assert runs(client).keys() == {second}
    launches = tmp_path / ".carstage-gui" / "launches"
    assert {path.name for path in launches.iterdir()} == {first, second}
    assert client.delete("/api/datasets/a").status_code < 300
    assert list(launches.iterdir()) == []


def test_each_run_that_was_started_here_is_shown_however_many_others_are_newer(
    client: TestClient,
    recorders: Recorders,
    tmp_path: Path,
    demo: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = done_run(client, recorders, demo, "a")
    monkeypatch.setattr("carstage.web.runs.records._MOST_PER_DATASET", 2)
    for number in range(3):
        FakeRun(tmp_path / "a", f"29990101-00000{number}-abcdef", demo).end()
    await_that(lambda: len(runs(client)) == 3)  # the look at the folders may be a second old
    assert (runs(client)[first].state, runs(client)[first].alive) == ("done", "ended")


def test_a_run_into_a_folder_of_a_dataset_is_shown_as_it_is(
    recorders: Recorders, tmp_path: Path, demo: dict[str, Any]
) -> None:
    root = tmp_path / "itself"
    (root / "commits").mkdir(parents=True)
    (root / "orders").symlink_to(recorders.orders)
    with open_site(root) as client:
        run_id = done_run(client, recorders, demo, "a")
        assert (runs(client)[run_id].state, runs(client)[run_id].alive) == ("done", "ended")
