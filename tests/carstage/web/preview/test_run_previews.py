"""Previews: made while somebody watches, of nothing else."""

import io
import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from carstage.rawlog.tail import NewestRecords
from carstage.spec import EpisodeSpec
from carstage.spec.agents import AgentSeeds, AgentSpec
from carstage.spec.sensors import PoseSpec
from carstage.web.preview import previewer
from carstage.web.preview.shown_sensors import shown_sensors
from sites import FakeRun, open_site
from waiting import await_that

LIVE = "ws://127.0.0.1:8321/api/live"


@pytest.fixture(scope="module")
def raw_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "log"
    analytic_scene.write_raw_log(folder, size=(96, 64))
    return folder


@pytest.fixture
def recording(fake_run: FakeRun, raw_log: Path) -> FakeRun:
    """A run whose current attempt has a raw log."""
    shutil.copytree(raw_log, fake_run.folder / "raw" / "e" / "a1")
    header = json.loads((raw_log / "episode.json").read_text())
    sensors = header["spec"]["sensors"]
    plan = json.loads((fake_run.folder / "plan.json").read_text())
    for episode in plan["episodes"]:
        episode["spec"]["sensors"] = sensors
    (fake_run.folder / "plan.json").write_text(json.dumps(plan))
    fake_run.say(current={"episode_id": "e", "index": 0, "attempt": "a1"})
    return fake_run


def previews(run: FakeRun) -> set[str]:
    folder = run.folder / "preview"
    if not folder.is_dir():
        return set()
    return {path.name for path in folder.glob("[!.]*.*")}


def test_a_run_that_nobody_watches_makes_none(recording: FakeRun, tmp_path: Path) -> None:
    with (
        open_site(tmp_path / "datasets") as client,
        client.websocket_connect(LIVE) as socket,
    ):
        assert socket.receive_json()["type"] == "snapshot"
        socket.send_json({"type": "watch", "run_id": recording.folder.name, "previews": False})
        for _ in range(3):
            socket.receive_json()
    assert not (recording.folder / "preview").exists()


def test_the_previewer_ends_when_the_sign_is_old(recording: FakeRun) -> None:
    folder = recording.folder / "preview"
    folder.mkdir()
    (folder / "want").touch()
    old = time.time() - previewer.WANT_S - 1
    os.utime(folder / "want", (old, old))
    assert previewer.main(recording.folder) == 0
    assert previews(recording) == set()


def test_whoever_watches_gets_the_newest_picture_of_each_sensor(
    recording: FakeRun, tmp_path: Path
) -> None:
    received: dict[int, bytes] = {}
    with (
        open_site(tmp_path / "datasets") as client,
        client.websocket_connect(LIVE) as socket,
    ):
        socket.send_json({"type": "watch", "run_id": recording.folder.name, "previews": True})
        channels: list[dict[str, Any]] = []
        while not channels or len(received) < len(channels):
            message = socket.receive()
            if message.get("bytes"):
                received[message["bytes"][0]] = message["bytes"]
            elif '"channels"' in message["text"][:30]:
                channels = json.loads(message["text"])["channels"]
        recording.say(state="done")
    assert {channel["kind"] for channel in channels} >= {"image", "points"}
    for channel in channels:
        packet = received[channel["channel"]]
        assert int.from_bytes(packet[4:8], "little") > 0
        if channel["kind"] == "image":
            picture = Image.open(io.BytesIO(packet[8:]))
            assert (picture.format, picture.width) == ("JPEG", 96)
        else:
            assert len(np.frombuffer(packet[8:], "<f4")) % 4 == 0


def test_pictures_are_small(raw_log: Path) -> None:
    record = NewestRecords(raw_log, "CAM_FRONT").look()
    assert record is not None
    small = previewer.draw_record("rgb", "0.9.16", record, width=48)
    assert Image.open(io.BytesIO(small)).size == (48, 32)


def test_one_previewer_works_on_a_run(recording: FakeRun) -> None:
    folder = recording.folder / "preview"
    folder.mkdir()
    (folder / "want").touch()
    soon = time.time() + 600
    os.utime(folder / "want", (soon, soon))
    command = [sys.executable, "-m", "carstage.web.preview.previewer", str(recording.folder)]
    with subprocess.Popen(command) as first:
        await_that(lambda: "index.json" in previews(recording))
        assert subprocess.run(command, check=False, timeout=60).returncode == 0
        assert first.poll() is None
        recording.say(state="done")
        assert first.wait(20) == 0


def test_sensors_of_agents_have_pictures_under_the_agent_s_name(
    raw_log: Path, tmp_path: Path
) -> None:
    attempt = tmp_path / "a1"
    shutil.copytree(raw_log, attempt)
    header = json.loads((attempt / "episode.json").read_text())
    spec = EpisodeSpec.from_json(header["spec"])
    camera = next(one for one in spec.written_sensors if one.kind == "rgb")
    mast = AgentSpec(
        "mast", "roadside", (camera,), AgentSeeds(1, 2), pose=PoseSpec(0, 0, 6, 0, 0, 0)
    )
    header["spec"] = replace(spec, agents=(mast,)).to_json()
    (attempt / "episode.json").write_text(json.dumps(header))
    (attempt / camera.id).rename(attempt / f"{camera.id}@1")
    shown = shown_sensors(EpisodeSpec.from_json(header["spec"]))
    assert [one.id for one in shown][-1] == f"mast.{camera.id}"
    pictures = tmp_path / "preview"
    pictures.mkdir()
    for stream in previewer._streams(attempt):
        stream.draw(pictures)
    assert (pictures / f"mast.{camera.id}.jpg").is_file()
    assert not (pictures / f"{camera.id}.jpg").exists()
