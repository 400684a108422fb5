"""Looking through a dataset: list, player, tables, statistics, validation."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from browser_pages import OpenPage

pytestmark = pytest.mark.xdist_group("browser")


def open_dataset(open_page: OpenPage) -> Page:
    page = open_page("#/datasets/scene")
    expect(page.get_by_role("heading", name="analytic <scene>")).to_be_visible()
    return page


def test_an_episode_is_scrubbed_stepped_and_played(open_page: OpenPage) -> None:
    page = open_dataset(open_page)
    page.get_by_role("link", name="Episode 1").click()
    shown = page.locator(".scene-cameras .camera")
    expect(shown).to_have_attribute("data-k", "0")
    last = int(page.get_by_role("slider", name="Frame").get_attribute("max") or 0)
    assert last > 0
    page.get_by_role("button", name="Frame forward").click()
    expect(shown).to_have_attribute("data-k", "1")
    page.get_by_role("slider", name="Frame").fill(str(last))
    expect(shown).to_have_attribute("data-k", str(last))
    page.get_by_role("button", name="Play").click()
    expect(shown).not_to_have_attribute("data-k", str(last))
    expect(shown).to_have_attribute("data-k", str(last))
    expect(page.get_by_role("button", name="Play")).to_be_visible()


def test_labels_are_drawn_and_an_object_is_followed(open_page: OpenPage) -> None:
    page = open_dataset(open_page)
    page.get_by_role("link", name="Episode 1").click()
    picture = page.locator(".scene-cameras .camera")
    picture.locator(".object").first.wait_for()
    boxes = picture.locator(".object line")
    expect(boxes).to_have_count(0)
    page.get_by_role("button", name="3D boxes").click()
    expect(boxes.first).to_be_attached()
    page.get_by_role("button", name="Masks").click()
    picture.locator("img.mask").wait_for()
    page.get_by_role("region", name="Objects in this frame").get_by_role("button").first.click()
    expect(page.locator(".road-user.object-chosen")).to_have_count(1)


def test_the_egos_signals_follow_the_frame_and_lead_to_another(open_page: OpenPage) -> None:
    page = open_dataset(open_page)
    page.get_by_role("link", name="Episode 1").click()
    speed = page.get_by_role("img", name="Speed over the episode")
    now = page.locator(".signal-now").first
    first = now.get_attribute("d")
    page.get_by_role("button", name="Frame forward").click()
    expect(now).not_to_have_attribute("d", first or "")
    box = speed.bounding_box()
    assert box is not None
    speed.click(position={"x": box["width"] - 1, "y": 10})
    slider = page.get_by_role("slider", name="Frame")
    expect(slider).to_have_value(slider.get_attribute("max") or "")


def test_rows_are_filtered_by_the_server(open_page: OpenPage) -> None:
    page = open_dataset(open_page)
    page.get_by_role("tab", name="Labels").click()
    rows = page.locator(".label-table tbody tr")
    rows.first.wait_for()
    total = page.locator(".table-tools .muted")
    before = total.inner_text()
    page.get_by_role("button", name="Filter").click()
    page.get_by_label("Column of filter 1").select_option("k")
    page.get_by_label("Comparison of filter 1").select_option("eq")
    page.get_by_label("Value of filter 1").fill("0")
    expect(total).not_to_have_text(before)
    column = [th.inner_text() for th in page.locator(".label-table th").all()].index("frame")
    assert {row.locator("td").nth(column).inner_text() for row in rows.all()} == {"0"}


def test_validation_says_what_holds(open_page: OpenPage) -> None:
    page = open_dataset(open_page)
    page.get_by_role("tab", name="Validation").click()
    page.get_by_role("button", name="Validate").click()
    page.locator(".checks li").first.wait_for(timeout=60_000)
    expect(page.locator(".validation").get_by_role("status")).to_contain_text("valid")
