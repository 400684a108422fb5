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


#: Counts what no keyboard makes: presses of a pointer, and clicks that a script makes.
NO_MOUSE = """
window.pressed = [];
for (const kind of ['pointerdown', 'mousedown'])
  addEventListener(kind, (event) => pressed.push(`${kind} ${event.target.outerHTML}`), true);
addEventListener('click', (event) => event.isTrusted || pressed.push('click by script'), true);
"""
#: How the focused element is called, as far as the journey has to know it.
FOCUSED = """(() => {
  const at = document.activeElement;
  const text = at.matches('a, button') ? at.innerText : '';
  return at.getAttribute('aria-label') ?? at.labels?.[0]?.innerText ?? text;
})()"""
MOST_TABS = 300


def tab_to(page: Page, name: str) -> None:
    """Press Tab until what has such a name has the focus."""
    wanted, seen = re.compile(name), []
    for _ in range(MOST_TABS):
        page.keyboard.press("Tab")
        seen.append(" ".join(page.evaluate(FOCUSED).split()))
        if wanted.fullmatch(seen[-1]):
            return
    raise AssertionError(f"Tab does not reach {name}: {seen}")


def type_into(page: Page, name: str, text: str) -> None:
    tab_to(page, name)
    page.keyboard.press("Control+A")
    page.keyboard.type(text)


def test_from_an_empty_page_to_an_exported_dataset_by_keys_alone(
    open_page: OpenPage, gui: Gui
) -> None:
    page = open_page(script=NO_MOUSE)
    page.locator("[data-saved=saved]").wait_for()
    type_into(page, "Name", "keys")
    for name, text in (("Duration.*", "0.3"), ("Vehicles", "0"), ("Pedestrians", "0"),
                       ("Image size: Width.*", "64"), ("Image size: Height.*", "36")):  # fmt: skip
        type_into(page, name, text)
    config = saved_config(page)
    assert (config["name"], config["duration_s"], config["image_size"]) == ("keys", 0.3, [64, 36])
    assert (config["vehicles"]["count"], config["pedestrians"]["count"]) == (0, 0)
    tab_to(page, "Start")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("keys")
    expect(page.locator(".page-head .badge")).to_have_text("done", timeout=RUN_MS)
    # The tile of the points stays, as those of the cameras do.
    last = page.get_by_label("Last pictures")
    last.locator('[data-sensor="LIDAR_TOP"] canvas:not([data-points=""])').wait_for()
    expect(last.locator('[data-sensor="CAM_FRONT"] img')).to_be_visible()

    tab_to(page, "Open the dataset")
    page.keyboard.press("Enter")
    page.get_by_role("link", name="Episode 1").wait_for()
    tab_to(page, "Episode 1.*")
    page.keyboard.press("Enter")
    page.locator('.scene-cameras [data-k="0"]').wait_for()
    page.keyboard.press("ArrowRight")
    page.locator('.scene-cameras [data-k="1"]').wait_for()
    page.keyboard.press("End")
    page.locator('.scene-cameras [data-k="2"]').wait_for()
    page.locator(".cloud-view[data-k='2']:not([data-points='0'])").wait_for()
    tab_to(page, "keys")
    page.keyboard.press("Enter")

    page.get_by_role("tab", name="Episodes").wait_for()
    tab_to(page, "Episodes")
    page.keyboard.press("ArrowLeft")  # round the row's end
    expect(page.get_by_role("tab", name="Export")).to_be_focused()
    page.get_by_role("radio", name="coco").wait_for()
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    while not page.get_by_role("radio", name="coco").is_checked():
        before = page.evaluate(FOCUSED)
        page.keyboard.press("ArrowDown")
        assert page.evaluate(FOCUSED) != before, "arrow keys go through the formats"
    tab_to(page, "Export")
    page.keyboard.press("Enter")
    page.locator('.job[data-state="done"]').wait_for(timeout=60_000)
    assert any(gui.datasets.glob("exports/keys-coco/**/*.json"))
    assert page.evaluate("pressed") == []


def test_from_an_empty_page_to_an_exported_dataset(open_page: OpenPage, gui: Gui) -> None:
    page = open_page()
    configure_small(page, "journey", FRAMES)
    page.get_by_role("button", name="Radar", exact=True).click()
    page.get_by_role("list", name="Sensors").get_by_role("button", name="CAM_FRONT").click()
    page.locator(".scene-host[data-ready=true]").wait_for()
    page.locator(".view-top .car-body").first.wait_for()
    picture(page, "gui-configure.png", gui)
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
    picture(page, "gui-run.png", gui)
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
    picture(page, "gui-episode.jpg", gui)

    page.goto(gui.url + "#/datasets/journey")
    page.get_by_role("tab", name="Export").click()
    page.get_by_role("radio", name="coco").check()
    page.get_by_role("button", name="Export", exact=True).click()
    page.locator('.job[data-state="done"]').wait_for(timeout=60_000)
    assert any(gui.datasets.glob("exports/journey-coco/**/*.json"))
    page.get_by_role("tab", name="Statistics").click()
    expect(page.get_by_role("heading", name="Objects by class")).to_be_visible()
    picture(page, "gui-datasets.png", gui)


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
