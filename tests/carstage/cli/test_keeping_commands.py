"""``carstage runs`` and ``carstage dataset``: what the page shows as commands does what it says."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from carstage import Dataset
from sites import FakeRun, open_site
from small_episodes import add_episode

RUN = "20260101-000000-abcdef"


def carstage(*arguments: str, text: str | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "carstage.cli", *arguments],
        input=text,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def shown(client: Any, **command: Any) -> list[str]:
    """The words of a command that the page shows, without the program."""
    answer = client.post("/api/command", json={"command": command})
    assert answer.status_code == 200, answer.text
    program, *words = shlex.split(answer.json()["text"])
    assert program == "carstage"
    return words


@pytest.fixture
def drives(tmp_path: Path) -> Path:
    place = tmp_path / "datasets" / "drives"
    place.mkdir(parents=True)
    add_episode(place, "0123456789abcdef")
    return place


def ended_run(place: Path, config: dict[str, Any]) -> FakeRun:
    description = (place / "dataset.json").read_bytes()
    run = FakeRun(place, RUN, config)
    (place / "dataset.json").write_bytes(description)
    run.end()
    run.say(state="interrupted", current=None)
    return run


def test_runs_are_compared_by_what_the_page_shows(drives: Path) -> None:
    one = ended_run(drives, {"name": "a drive", "fps": 10.0, "map": {"choice": "Stage01"}})
    two = FakeRun(drives, f"{RUN[:-1]}0", {"name": "b", "fps": 20.0, "map": {"choice": "Stage01"}})
    two.end()
    with open_site(drives.parent) as client:
        ids = [one.folder.name, two.folder.name]
        told = client.get("/api/comparison", params={"run": ids}).json()
        words = shown(client, do="compare-runs", run_ids=ids)
        assert client.get("/api/comparison", params={"run": ids[:1]}).status_code == 422
        assert client.get("/api/comparison", params={"run": ["a", "b"]}).status_code == 404
    assert told["settings"] == [{"path": "fps", "title": "Frame rate (Hz)", "values": [10.0, 20.0]}]
    assert [entry["run"]["run_id"] for entry in told["runs"]] == ids
    printed = json.loads(carstage(*words, "--json").stdout)
    assert [entry["state"] for entry in printed["runs"]] == ["interrupted", "dead"]
    assert [entry["figures"]["state"] for entry in told["runs"]] == ["interrupted", "dead"]
    assert printed["settings"] == [{"path": "fps", "values": [10.0, 20.0]}]
    lines = carstage(*words).stdout.splitlines()
    assert lines[1].split() == ["name", "a", "drive", "b"]
    assert lines[-1].split() == ["fps", "10.0", "20.0"]
    refused = carstage("runs", "compare", str(drives), str(one.folder))
    assert refused.returncode == 2
    assert "is no run's folder" in refused.stderr


def test_runs_are_listed_renamed_and_removed_by_what_the_page_shows(drives: Path) -> None:
    run = ended_run(drives, {"name": "a drive"})
    with open_site(drives.parent) as client:
        named = carstage(*shown(client, do="rename-run", run_id=RUN, name="Rain; at night"))
        assert named.returncode == 0, named.stderr
        (line,) = carstage("runs", "list", str(drives)).stdout.splitlines()
        assert line.split()[:2] == [RUN, "interrupted"]
        assert line.endswith("Rain; at night")
        listed = json.loads(carstage("runs", "list", str(drives), "--json").stdout)["runs"]
        assert listed[0]["name"] == "Rain; at night"
        (there,) = client.get("/api/runs").json()["runs"]
        assert there["name"] == "Rain; at night"
        gone = carstage(*shown(client, do="delete-run", run_id=RUN))
        assert gone.returncode == 0, gone.stderr
    assert not run.folder.exists()
    assert [episode.id for episode in Dataset(drives).episodes] == ["0123456789abcdef"]
    missing = carstage("runs", "delete", str(drives), RUN, "--yes")
    assert (missing.returncode, "has no run" in missing.stderr) == (2, True)


def test_what_goes_on_is_not_removed_and_stops_when_told(drives: Path) -> None:
    run = FakeRun(drives, RUN, {"name": "a drive"})
    try:
        for refused in (
            carstage("runs", "delete", str(drives), RUN, "--yes"),
            carstage("runs", "resume", str(drives), RUN),
            carstage("dataset", "delete", str(drives), "--yes"),
        ):
            assert refused.returncode == 2
            assert "Stop it first" in refused.stderr or "stop it first" in refused.stderr
        with open_site(drives.parent) as client:
            assert client.delete("/api/datasets/drives").status_code == 409
            told = carstage(*shown(client, do="stop", run_id=RUN))
        assert told.returncode == 0, told.stderr
        assert run.process.wait(20) != 0
    finally:
        run.end()


def test_nobody_who_cannot_be_asked_loses_anything(drives: Path) -> None:
    refused = carstage("dataset", "delete", str(drives))
    assert (refused.returncode, "--yes" in refused.stderr) == (2, True)
    assert Dataset(drives).episodes
    stranger = carstage("dataset", "delete", str(drives.parent), "--yes")
    assert stranger.returncode != 0
    assert drives.exists()


def test_a_link_to_a_dataset_is_not_removed(drives: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(drives)
    refused = carstage("dataset", "delete", str(link), "--yes")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert f"{link} is a link" in refused.stderr
    assert len(Dataset(drives).episodes) == 1


def test_datasets_are_renamed_and_removed_by_what_the_page_shows(drives: Path) -> None:
    (drives / "my notes.txt").write_text("mine")
    outside = drives.parent.parent / "outside"
    outside.mkdir()
    (outside / "kept").touch()
    (drives / "episodes" / "link").symlink_to(outside)
    with open_site(drives.parent) as client:
        named = carstage(*shown(client, do="rename-dataset", dataset="drives", name="Rain"))
        assert named.returncode == 0, named.stderr
        assert Dataset(drives).name == "Rain"
        gone = carstage(*shown(client, do="delete-dataset", dataset="drives"))
        assert gone.returncode == 0, gone.stderr
        assert "my notes.txt" in gone.stderr
    assert [path.name for path in drives.iterdir()] == ["my notes.txt"]
    assert (outside / "kept").exists()


def test_exports_are_made_and_removed_by_what_the_page_shows(tmp_path: Path) -> None:
    from analytic_dataset import make_dataset

    root = tmp_path / "datasets"
    root.mkdir()
    make_dataset(root / "town", tmp_path / "work")
    with open_site(root) as client:
        asked = {"format": "yolo", "boxes": "modal", "include_invisible": True}
        words = shown(client, do="export", dataset="town", export=asked)
        assert words[-3:] == ["--boxes", "modal", "--include-invisible"]
        made = carstage(*words)
        assert made.returncode == 0, made.stderr
        (entry,) = client.get("/api/exports").json()["exports"]
        assert (entry["name"], entry["format"], entry["bytes"] > 0) == ("town-yolo", "yolo", True)
        command = {"do": "rename-export", "name": "town-yolo", "new_name": "mine"}
        text = client.post("/api/command", json={"command": command}).json()["text"]
        subprocess.run(shlex.split(text), check=True, timeout=60)
        assert [e["name"] for e in client.get("/api/exports").json()["exports"]] == ["mine"]
        assert client.patch("/api/exports/mine", json={"name": "yours"}).status_code == 200
        assert client.get("/api/exports/yours/files.zip").content[:2] == b"PK"
        gone = carstage(*shown(client, do="delete-export", name="yours"))
        assert gone.returncode == 0, gone.stderr
        assert client.get("/api/exports").json()["exports"] == []
        checked = carstage(*shown(client, do="validate", dataset="town"))
        assert checked.returncode == 0, checked.stdout
        told = carstage(*shown(client, do="report", dataset="town"))
        assert told.returncode == 0, told.stderr
        assert (root / "town" / "report.html").stat().st_size > 10_000


def test_a_start_is_one_command_with_its_configuration(tmp_path: Path) -> None:
    root = tmp_path / "datasets"
    root.mkdir()
    with open_site(root) as client:
        demo = client.get("/api/schema").json()["demo"]
        small = {**demo, "episodes": 1, "duration_s": 0.2, "image_size": [64, 36],
                 "name": "it's CONFIG", "rig": {"sensors": [{"id": "CAM", "kind": "rgb"}]},
                 "vehicles": {"count": 0}, "pedestrians": {"count": 0}}  # fmt: skip
        run = {"dataset": "made", "config": small, "retries": 0}
        command = {"do": "start", "run": run}
        text = client.post("/api/command", json={"command": command}).json()["text"]
        ended = subprocess.run(
            ["bash", "-c", text.replace("carstage", f"{sys.executable} -m carstage.cli", 1)],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert ended.returncode == 0, ended.stderr
        assert len(Dataset(root / "made").episodes) == 1
        (made,) = client.get("/api/runs").json()["runs"]
        assert (made["state"], made["name"]) == ("done", "it's CONFIG")
        # The plan of a run is enough to record the rest, or nothing, once more.
        again = carstage("runs", "resume", str(root / "made"), made["run_id"], "--json")
        assert again.returncode == 0, again.stderr
        assert json.loads(again.stdout.splitlines()[-1])["episodes"]["skipped"] == 1
