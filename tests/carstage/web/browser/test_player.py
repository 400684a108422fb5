"""The player: panels, all cameras, points by colour, picking, time lanes, jumps, comparison."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page, expect

import analytic_dataset
from browser_pages import Gui, OpenPage, wait_until

pytestmark = pytest.mark.xdist_group("browser")

OTHER = "00000000000000ab"


@pytest.fixture(scope="module")
def gui(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gui]:
    """A server over a dataset of two episodes of the same scene."""
    folder = tmp_path_factory.mktemp("player") / "datasets"
    folder.mkdir()
    work = tmp_path_factory.mktemp("scenes")
    analytic_dataset.make_dataset(folder / "scene", work)
    analytic_dataset.add_episode(folder / "scene", work, OTHER, 4)
    made = Gui(folder)
    made.start()
    try:
        yield made
    finally:
        made.stop()


def open_player(open_page: OpenPage, query: str = "", **options: Any) -> Page:
    page = open_page("#/datasets", **options)
    answer: dict[str, Any] = page.evaluate("fetch('api/datasets/scene').then((a) => a.json())")
    ids = [one["episode_id"] for one in answer["episodes"]]
    own = next(one for one in ids if one != OTHER)
    page.evaluate(f"location.hash = '#/datasets/scene/{own}{query}'")
    page.locator(".camera img").first.wait_for()
    return page


def ready_cloud(page: Page) -> None:
    page.locator(".cloud-view:not([data-points='0'])").wait_for()
    wait_until(page, "Boolean(window.carstageCloud) && carstageCloud.drawn() > 0")


def width_of(page: Page, selector: str) -> float:
    box = page.locator(selector).first.bounding_box()
    assert box is not None
    return float(box["width"])


def test_panels_get_the_size_that_was_chosen_and_keep_it(open_page: OpenPage) -> None:
    page = open_player(open_page)
    before = width_of(page, ".scene-cameras")
    handle = page.get_by_role("separator", name="Width of the cameras")
    handle.focus()
    for _ in range(5):
        page.keyboard.press("ArrowLeft")
    narrower = width_of(page, ".scene-cameras")
    assert narrower < before - 50
    box = handle.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + box["height"] / 2, steps=3)
    page.mouse.up()
    wider = width_of(page, ".scene-cameras")
    assert wider > narrower + 100
    page.reload()
    page.locator(".camera img").first.wait_for()
    assert width_of(page, ".scene-cameras") == pytest.approx(wider, abs=3)


def test_all_cameras_are_shown_at_once(open_page: OpenPage) -> None:
    page = open_player(open_page)
    page.get_by_role("button", name="All cameras").click()
    grid = page.locator(".camera-grid .camera")
    expect(grid).to_have_count(5)
    expect(page.locator(".camera-grid .camera[data-k='0']")).to_have_count(5)
    page.keyboard.press("ArrowRight")
    expect(page.locator(".camera-grid .camera[data-k='1']")).to_have_count(5)
    expect(page.locator(".cloud-view")).to_have_attribute("data-k", "1")


def test_keys_play_and_step_after_a_click_on_a_button(open_page: OpenPage) -> None:
    page = open_player(open_page)
    page.get_by_role("button", name="3D boxes").click()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("slider", name="Frame")).to_have_value("1")
    page.keyboard.press("Space")
    expect(page.get_by_role("slider", name="Frame")).to_have_value("5")
    expect(page.get_by_role("button", name="3D boxes")).to_have_attribute("aria-pressed", "true")


def test_points_take_the_colours_that_were_asked_for(open_page: OpenPage) -> None:
    page = open_player(open_page)
    ready_cloud(page)
    canvas, scale = page.locator(".cloud-view canvas"), page.locator(".scale")
    pictures = {"height": canvas.screenshot()}
    for by in ("value", "class", "instance", "range"):
        page.get_by_label("Colour of points").select_option(by)
        expect(page.locator(".cloud-view")).to_have_attribute("data-colour", by)
        page.wait_for_timeout(300)
        pictures[by] = canvas.screenshot()
        expect(scale).to_have_count(1 if by in ("value", "range") else 0)
    assert len(set(pictures.values())) == len(pictures)


def test_sweeps_are_put_together(open_page: OpenPage) -> None:
    page = open_player(open_page, "?k=4")
    ready_cloud(page)
    cloud = page.locator(".cloud-view")
    one = int(cloud.get_attribute("data-points") or 0)
    page.get_by_label("Sweeps").select_option("3")
    expect(cloud).not_to_have_attribute("data-points", str(one))
    assert int(cloud.get_attribute("data-points") or 0) == pytest.approx(3 * one, rel=0.1)


def cloud_picture(page: Page) -> NDArray[np.uint8]:
    """``(H, W, 3)`` what the view of the points shows."""
    ready_cloud(page)
    png = page.locator(".cloud-view canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def test_points_look_the_same_whether_webgl_draws_them_or_the_page(open_page: OpenPage) -> None:
    page = open_player(open_page)
    by_page = cloud_picture(page)
    assert page.evaluate("carstageCloud.software")
    page.add_init_script(
        "const known = WebGL2RenderingContext.prototype.getExtension;"
        "WebGL2RenderingContext.prototype.getExtension = function (name) {"
        " return name === 'WEBGL_debug_renderer_info' ? null : known.call(this, name); };"
    )
    page.reload()
    by_webgl = cloud_picture(page)
    assert not page.evaluate("carstageCloud.software")
    background = by_webgl[0, 0]
    drawn = [(one != background).any(axis=2) for one in (by_page, by_webgl)]
    assert min(one.mean() for one in drawn) > 0.02
    assert (drawn[0] != drawn[1]).mean() < 0.02
    both = drawn[0] & drawn[1]
    assert np.abs(by_page[both].astype(int) - by_webgl[both]).mean() < 8.0


def test_a_picked_box_or_point_shows_its_row(open_page: OpenPage) -> None:
    page = open_player(open_page)
    ready_cloud(page)
    page.get_by_role("button", name="Above").click()
    row = page.locator(".facts tr[data-track]").first
    track = row.get_attribute("data-track")
    frame: dict[str, Any] = page.evaluate(
        "fetch('api/datasets/scene/episodes/' + location.hash.split('/')[3].split('?')[0] +"
        " '/frames/0').then((a) => a.json())"
    )
    box = next(o for o in frame["objects"] if str(o["track_id"]) == track)
    place = [line[3] for line in box["ego_from_box"][:3]]
    at = page.evaluate(f"carstageCloud.project({place[0]}, {place[1]}, {place[2]})")
    page.locator(".cloud-view canvas").click(position={"x": at[0], "y": at[1]})
    expect(page.locator(f'.facts tr[data-track="{track}"]')).to_have_attribute(
        "aria-selected", "true"
    )
    expect(page.get_by_role("region", name="Label of the chosen object")).to_be_visible()
    # The ground has points, too, which belong to nobody.
    found = page.evaluate(
        "(async () => { const [base] = location.hash.slice(1).split('?');"
        " const [, , dataset, episode] = base.split('/');"
        " const answer = await fetch(`api/datasets/${dataset}/episodes/${episode}/points/"
        "LIDAR_TOP/0`); const points = new Float32Array(await answer.arrayBuffer());"
        " for (let i = 0; i < points.length; i += 4) { const [x, y, z] = points.slice(i, i + 3);"
        " if (z < 0.1 && Math.hypot(x, y) < 6) return [...carstageCloud.project(x, y, z)]; }"
        " return null; })()"
    )
    assert found is not None
    page.locator(".cloud-view canvas").click(position={"x": found[0], "y": found[1]})
    expect(page.get_by_role("status", name="Picked point")).to_contain_text("m from the ego")


def test_lanes_lead_to_frames_and_objects(open_page: OpenPage) -> None:
    page = open_player(open_page)
    lanes = page.get_by_role("region", name="Tracks over time")
    expect(lanes.get_by_text("Weather")).to_be_visible()
    lane = lanes.get_by_role("button", name=re.compile("^truck"))
    lane.click()
    expect(lane).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".road-user.object-chosen")).to_have_count(1)
    bars = lanes.locator(".lane-bars").first
    box = bars.bounding_box()
    assert box is not None
    bars.click(position={"x": box["width"] - 3, "y": 5})
    expect(page.get_by_role("slider", name="Frame")).to_have_value("5")


def test_jumps_lead_to_near_pedestrians_and_hidden_objects(open_page: OpenPage) -> None:
    page = open_player(open_page)
    jump = page.get_by_label("Jump to")
    near = jump.locator("option", has_text="Pedestrian under 20 m")
    expect(near.first).to_be_attached()
    hidden = jump.locator("option", has_text="Most occluded").first
    text = hidden.inner_text()
    jump.select_option(value=hidden.get_attribute("value"))
    k = re.search(r"frame (\d+)", text)
    assert k is not None
    expect(page.locator(".scene-cameras .camera")).to_have_attribute("data-k", k[1])
    expect(page.locator(".scene-cameras .object-chosen")).to_have_count(1)
    page.get_by_label("A pedestrian is near under").select_option("5")
    expect(jump.locator("option", has_text="Pedestrian under 20 m")).to_have_count(0)


def test_two_episodes_are_compared_in_step(open_page: OpenPage) -> None:
    page = open_player(open_page)
    choice = page.get_by_label("Compare with")
    choice.focus()
    expect(choice.locator(f"option[value='{OTHER}']")).to_be_attached()
    choice.select_option(OTHER)
    other = page.locator(".compared")
    expect(other).to_have_attribute("data-k", "0")
    for k in (1, 2):
        page.get_by_role("button", name="Frame forward").click()
        expect(other).to_have_attribute("data-k", str(k))
    page.get_by_role("slider", name="Frame").fill("5")
    expect(other).to_have_attribute("data-k", "3")
    expect(other).to_contain_text("ends before")
    page.reload()
    expect(other).to_be_visible()


def test_an_episode_is_handed_over_by_one_press(open_page: OpenPage, gui: Gui) -> None:
    page = open_player(open_page)
    page.get_by_role("button", name="Foxglove").click()
    note = page.locator(".hand-over-note")
    expect(note).to_contain_text("foxglove-studio", timeout=60_000)
    files = list(gui.datasets.glob("exports/*/*.mcap"))
    assert len(files) == 1, "this episode alone"
    assert files[0].name in note.inner_text()
    page.get_by_role("button", name="Rerun").click()
    expect(note).to_contain_text(f"rerun {files[0].relative_to(gui.datasets)}")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_at_390_px_the_player_is_no_wider_than_the_screen(open_page: OpenPage, theme: str) -> None:
    page = open_player(open_page, width=390, height=844, theme=theme)
    over = "document.querySelector('.content').scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(over) <= 0
    page.get_by_role("button", name="Frame forward").click()
    expect(page.locator(".scene-cameras .camera")).to_have_attribute("data-k", "1")
