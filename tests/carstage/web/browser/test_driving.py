"""A person drives from the page: a scripted Gamepad API, a recorded drive, the same bytes again."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from playwright.sync_api import Page, expect

import carstage
from browser_pages import PICTURES, Gui, OpenPage, picture
from carstage.dataset import Episode
from running_simulator import RunningSimulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("browser"), pytest.mark.timeout(600)]

FPS, DURATION_S = 10, 25.0
"""Steps go at the pace of the clock, and on a busy machine pictures come seconds late."""
STEPS_S = 120.0
"""So long may a run take to begin, and to make its first steps, on a busy machine."""
PAD = """
  window.pad = {
    id: 'Scripted pad', index: 0, connected: true, timestamp: 1, mapping: 'standard',
    axes: [0, 0, 0, 0],
    buttons: Array.from({length: 17}, () => ({value: 0, pressed: false, touched: false})),
  };
  window.hold = (number, value) => {
    window.pad.buttons[number] = {value, pressed: value > 0.5, touched: value > 0};
  };
  navigator.getGamepads = () => [window.pad, null, null, null];
"""
RIGHT_TRIGGER = 7


def configuration(simulator: RunningSimulator, driver: dict[str, Any]) -> dict[str, Any]:
    at_host = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    camera = {"id": "CAM", "kind": "rgb", "pose": {"x": 0.5, "z": 1.4}}
    return {
        "name": "driven at the page",
        "seed": 3,
        "map": {"choice": "Stage01"},
        "fps": FPS,
        "duration_s": DURATION_S,
        "vehicles": {"count": 2},
        "pedestrians": {"count": 0},
        "timing": {"warmup_ticks": 4},
        "image_size": [640, 360] if PICTURES else [160, 90],
        "labels": {"cameras": []},
        "conversion": {"workers": 1},
        "rig": {"sensors": [camera, {"id": "IMU", "kind": "imu"}]},
        "ego": {"driver": driver},
        "server": {**at_host, "self_test": "off"},
    }


@pytest.fixture
def gui(tmp_path: Path) -> Iterator[Gui]:
    """A server over a folder in which nothing is."""
    folder = tmp_path / "datasets"
    folder.mkdir()
    made = Gui(folder)
    made.start()
    try:
        yield made
    finally:
        made.stop()


@pytest.fixture
def going(
    gui: Gui, simulator: RunningSimulator, tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[subprocess.Popen[bytes]]:
    """A run that waits for somebody who drives at the page."""
    file = tmp_path / "drive.yaml"
    config = configuration(simulator, {"kind": request.param, "where": "page"})
    file.write_text(yaml.safe_dump(config))
    out = gui.datasets / "driven"
    command = [sys.executable, "-m", "carstage.cli", "run", str(file), "--out", str(out)]
    with (tmp_path / "run.log").open("wb") as log:
        run = subprocess.Popen([*command, "--retries", "0"], stderr=log, stdin=subprocess.DEVNULL)
    try:
        yield run
    finally:
        if run.poll() is None:
            run.terminate()
        run.wait(60)


def begin(open_page: OpenPage, script: str = "") -> Page:
    page = open_page("#/run", script=script)
    button = page.get_by_role("button", name="Drive", exact=True)
    expect(button).to_be_visible(timeout=STEPS_S * 1000)
    button.click()
    return page


def shown_tick(page: Page) -> int:
    """The step of the picture that the driver sees, -1 before the first one."""
    shown = "Number(document.querySelector('.drive .thumb-picture')?.dataset.tick || -1)"
    return int(page.evaluate(shown))


def until_tick(page: Page, tick: int) -> None:
    """Until the picture that the driver sees is of that step, or of a later one."""
    deadline = time.monotonic() + STEPS_S
    while shown_tick(page) < tick:
        assert time.monotonic() < deadline, f"no picture of step {tick} within {STEPS_S} s"
        page.wait_for_timeout(50)


def only(folder: Path) -> Episode:
    (episode,) = carstage.Dataset(folder).episodes
    return episode


def commands(episode: Episode) -> list[dict[str, Any]]:
    table = episode.controls()
    assert table is not None
    return table.to_pylist()


def sensor_files(episode: Episode) -> dict[str, bytes]:
    """What the sensors gave, by file."""
    files = [path for path in episode.folder.glob("sensors/**/*") if path.is_file()]
    return {path.relative_to(episode.folder).as_posix(): path.read_bytes() for path in files}


def tables(episode: Episode) -> dict[str, pa.Table]:
    """All tables, without what holds the episode's id."""
    found = {}
    for path in episode.folder.glob("*.parquet"):
        table = pq.read_table(path)
        own = {"episode_id", "instance_uid"} & set(table.column_names)
        found[path.name] = table.drop_columns(sorted(own))
    return found


@pytest.mark.parametrize("going", ["gamepad"], indirect=True)
def test_a_gamepad_at_the_page_drives_and_its_drive_replays_to_the_same_bytes(
    gui: Gui,
    open_page: OpenPage,
    going: subprocess.Popen[bytes],
    simulator: RunningSimulator,
    tmp_path: Path,
) -> None:
    page = begin(open_page, PAD)
    expect(page.locator(".drive").get_by_role("status")).to_have_text("You drive: Scripted pad")
    until_tick(page, 2)
    page.evaluate(f"hold({RIGHT_TRIGGER}, 0.8)")
    until_tick(page, 12)
    expect(page.get_by_label("Throttle")).to_have_attribute("value", "0.8")
    picture(page, "driving-at-the-page.jpg", gui)
    page.evaluate("pad.axes = [0.4, 0, 0, 0]")
    until_tick(page, 30)
    page.context.close()  # the page goes while the throttle is down: the car brakes
    assert going.wait(300) == 0, (tmp_path / "run.log").read_text()

    driven = only(gui.datasets / "driven")
    rows = commands(driven)
    assert [row["tick"] for row in rows] == list(range(round(DURATION_S * FPS)))
    assert rows[0]["throttle"] == 0.0
    held = [row for row in rows if row["throttle"] == pytest.approx(0.8)]
    assert len(held) >= 10
    assert held[-1]["steer"] == pytest.approx(0.4)
    assert {row["reverse"] for row in rows} == {False}
    assert (rows[-1]["throttle"], rows[-1]["brake"]) == (0.0, 1.0)
    assert rows[-1]["steer"] == pytest.approx(0.4)
    speeds = driven.ego()["speed"].to_pylist()
    assert max(speeds) > 2.0
    assert speeds[-1] < max(speeds) - 1.0
    frames = driven.ledger()["server_frame"].to_pylist()
    assert [row["server_frame"] for row in rows] == frames
    assert carstage.validate(gui.datasets / "driven").ok

    replay = {"kind": "replay", "episode": str(driven.folder)}
    result = carstage.run(configuration(simulator, replay), tmp_path / "again", retries=0)
    assert not result.failures
    again = only(tmp_path / "again")
    first, second = sensor_files(driven), sensor_files(again)
    assert len(first) == round(DURATION_S * FPS) + 1
    assert first == second
    ours, theirs = tables(driven), tables(again)
    assert {"controls.parquet", "objects.parquet"} < ours.keys() == theirs.keys()
    for name, table in ours.items():
        assert table.equals(theirs[name]), name


@pytest.mark.parametrize("going", ["keyboard"], indirect=True)
def test_keys_drive_at_the_page_and_a_page_without_focus_lets_go(
    gui: Gui, open_page: OpenPage, going: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    page = begin(open_page)
    until_tick(page, 2)
    page.keyboard.down("w")
    until_tick(page, shown_tick(page) + 40)  # the run may be some steps ahead of the picture
    page.keyboard.press("q")  # shorter than a step: it counts all the same
    until_tick(page, shown_tick(page) + 20)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    until_tick(page, shown_tick(page) + 40)
    page.get_by_role("button", name="Stop driving").click()
    assert going.wait(300) == 0, (tmp_path / "run.log").read_text()
    rows = commands(only(gui.datasets / "driven"))
    throttle = [row["throttle"] for row in rows]
    assert throttle[0] == 0.0
    assert max(throttle) > 0.5, "a tenth more in each step"
    assert throttle[-1] == 0.0
    assert [row["reverse"] for row in rows].count(True) > 0
    assert rows[-1]["brake"] == 1.0


def test_what_is_no_message_of_a_device_writes_nothing(gui: Gui, open_page: OpenPage) -> None:
    page = open_page("#/run")
    bad = [
        {"run_id": "../../x", "held": [], "presses": {}, "axes": []},
        {"run_id": "20260101-000000-abcdef", "held": [], "presses": {}, "axes": []},
        {"run_id": "20260101-000000-abcdef", "held": ["rm"], "presses": {}, "axes": [9]},
    ]
    for message in bad:
        whole = json.dumps({"type": "drive", "sender": "a", "sequence": 1, **message})
        page.evaluate(
            """(text) => new Promise((done) => {
              const address = new URL('api/live', document.baseURI);
              address.protocol = 'ws:';
              address.hash = '';
              const socket = new WebSocket(address);
              socket.onmessage = () => { socket.send(text); socket.close(); };
              socket.onclose = () => done(null);
            })""",
            whole,
        )
    assert list(gui.datasets.rglob("inputs.json")) == []
