"""From an empty page to an exported dataset, on the embedded simulator; and what may go wrong."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from browser_pages import (
    PICTURES,
    Gui,
    OpenPage,
    Watch,
    field,
    load_demo,
    picture,
    saved_config,
)

pytestmark = [pytest.mark.xdist_group("journey"), pytest.mark.end_to_end]

RUN_MS = 200_000
#: The canvas of a live picture that has come.
SHOWN = 'canvas[data-tick]:not([data-tick=""])'
FRAMES = 50 if PICTURES else 20


@pytest.fixture(scope="module")
def gui(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gui]:
    """A server over an empty folder."""
    folder = tmp_path_factory.mktemp("journey") / "datasets"
    folder.mkdir()
    made = Gui(folder)
    made.start()
    try:
        yield made
    finally:
        made.stop()


def configure_small(page: Page, name: str, frames: int) -> None:
    """The demonstration, shorter and smaller; as it is when pictures are made."""
    load_demo(page)
    field(page, "Name").fill(name)
    field(page, "Duration").fill(str(frames / 10))
    traffic = page.get_by_role("region", name="Traffic")
    traffic.get_by_role("textbox", name="Vehicles").fill("20" if PICTURES else "8")
    traffic.get_by_role("textbox", name="Pedestrians").fill("10" if PICTURES else "4")
    if not PICTURES:
        page.get_by_label("Image size: Width").first.fill("160")
        page.get_by_label("Image size: Height").first.fill("90")
    assert saved_config(page)["name"] == name


def runs(page: Page) -> list[dict[str, Any]]:
    answer: dict[str, Any] = page.evaluate("fetch('api/runs').then((a) => a.json())")
    found: list[dict[str, Any]] = answer["runs"]
    return found


def test_from_an_empty_page_to_an_exported_dataset(open_page: OpenPage, gui: Gui) -> None:
    page = open_page()
    configure_small(page, "journey", FRAMES)
    page.get_by_role("button", name="Radar", exact=True).click()
    page.get_by_role("list", name="Sensors").get_by_role("button", name="CAM_FRONT").click()
    page.locator(".scene-host[data-ready=true]").wait_for()
    page.locator(".view-top .car-body").first.wait_for()
    picture(page, "gui-configure", gui)
    page.get_by_role("button", name="Start", exact=True).click()
    expect(page.get_by_role("heading", name="journey")).to_be_visible()
    stop = page.get_by_role("button", name="Stop", exact=True)
    expect(stop).to_be_visible()

    # Reload in mid-run: everything is there again.
    page.reload()
    expect(page.get_by_role("heading", name="journey")).to_be_visible()
    expect(stop).to_be_visible()
    page.locator(SHOWN).first.wait_for(timeout=RUN_MS)
    for sensor in ("CAM_FRONT", "CAM_LEFT", "DEPTH_FRONT", "LIDAR_TOP", "RADAR"):
        page.locator(f'[data-sensor="{sensor}"] {SHOWN}').wait_for()
    expect(page.get_by_label("Log of journey").get_by_role("listitem").nth(3)).to_be_visible()
    if PICTURES:
        page.get_by_text(re.compile(r"^[1-9]\d* / 50 frames$")).wait_for(timeout=RUN_MS)
        expect(page.locator(SHOWN)).to_have_count(7)
    picture(page, "gui-run", gui)
    badge = page.locator(".page-head .badge")
    expect(badge).to_have_text("done", timeout=RUN_MS)
    expect(page.get_by_text("1 of 1")).to_be_visible()

    page.get_by_role("link", name="Open the dataset").click()
    expect(page.get_by_role("heading", name="journey")).to_be_visible()
    page.get_by_role("link", name="Episode 1").click()
    large = page.locator('.scene-cameras [data-sensor="CAM_FRONT"][data-k="0"]')
    large.wait_for()
    page.get_by_role("button", name="3D boxes").click()
    page.get_by_role("slider", name="Frame").fill(str(FRAMES // 2))
    page.locator(f'.scene-cameras [data-k="{FRAMES // 2}"]').wait_for()
    page.locator(".cloud-view:not([data-points='0'])").wait_for()
    page.locator(".map-view .lane").first.wait_for()
    picture(page, "gui-episode", gui)

    page.goto(gui.url + "#/datasets/journey")
    page.get_by_role("tab", name="Export").click()
    page.get_by_label("coco").check()
    page.get_by_role("button", name="Export", exact=True).click()
    page.locator('.job[data-state="done"]').wait_for(timeout=60_000)
    assert any(gui.datasets.glob("exports/journey-coco/**/*.json"))
    page.get_by_role("tab", name="Statistics").click()
    expect(page.get_by_role("heading", name="Objects by class")).to_be_visible()
    picture(page, "gui-datasets", gui)


def test_a_killed_interface_finds_its_run_again_and_another_browser_stops_it(
    open_page: OpenPage, gui: Gui, watch: Watch
) -> None:
    page, other = open_page(), open_page("#/run")
    configure_small(page, "long", 3000)
    page.get_by_role("button", name="Start", exact=True).click()
    expect(page.get_by_role("heading", name="long")).to_be_visible()
    expect(page.get_by_role("button", name="Stop", exact=True)).to_be_visible()
    run = next(one for one in runs(page) if one["name"] == "long")

    # Another run waits until it is its turn, and is taken out again.
    other.evaluate("location.hash = '#/configure'")
    other.get_by_role("button", name="Queue", exact=True).click()
    badge = other.locator(".page-head .badge")
    expect(badge).to_have_text("queued, place 1")
    other.get_by_role("button", name="Take out").click()
    # Not before the server knows: a request under way would die with it, and the queue would last.
    expect(other.get_by_text("queued, place 1")).to_have_count(0)
    other.evaluate("location.hash = '#/run'")

    watch.server_may_be_gone = True
    gui.kill()
    expect(page.get_by_role("status").filter(has_text="reconnecting")).to_be_visible()
    gui.start()
    expect(page.get_by_role("status").filter(has_text="connected")).to_be_visible(timeout=30_000)
    again = next(one for one in runs(page) if one["run_id"] == run["run_id"])
    assert again["alive"] == "running"
    page.get_by_label("Log of long").get_by_text("has begun").wait_for()

    expect(other.get_by_role("heading", name="long")).to_be_visible(timeout=30_000)
    other.get_by_role("button", name="Stop", exact=True).click()
    expect(page.locator(".page-head .badge")).to_have_text("stopped", timeout=60_000)
    expect(other.locator(".page-head .badge")).to_have_text("stopped", timeout=20_000)
