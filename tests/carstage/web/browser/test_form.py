"""Parameters: what is wrong is said at its field; text and form are one document."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from browser_pages import (
    OpenPage,
    field,
    saved_config,
    server_config,
    wait_until_saved,
    wait_until_saved_as,
)

pytestmark = pytest.mark.xdist_group("browser")


def test_a_wrong_value_is_told_at_its_field_and_start_is_off(configure: Page) -> None:
    page = configure
    start = page.get_by_role("button", name="Start", exact=True)
    expect(start).to_be_enabled()
    episodes = field(page, "Episodes")
    episodes.fill("0")
    error = page.locator("#field-episodes-error")
    expect(error).to_contain_text("at least 1")
    expect(episodes).to_have_attribute("aria-invalid", "true")
    expect(start).to_be_disabled()
    episodes.fill("two")
    expect(error).to_contain_text("whole number")
    episodes.fill("3")
    expect(error).to_have_count(0)
    expect(start).to_be_enabled()
    expect(page.get_by_role("status").filter(has_text="150 frames")).to_be_visible()
    assert saved_config(page)["episodes"] == 3


def test_an_error_below_more_opens_it(configure: Page) -> None:
    page = configure
    timing = page.locator("details.group", has_text="Timing").locator("summary").first
    timing.click()
    field(page, "Warm-up").fill("-1")
    expect(page.locator("#field-timing-warmup_ticks-error")).to_contain_text("too small")
    page.reload()
    expect(page.get_by_role("button", name="Start", exact=True)).to_be_enabled()
    assert saved_config(page)["timing"]["warmup_ticks"] == 20, "it never reached the server"


def test_maps_are_one_or_drawn(configure: Page) -> None:
    page = configure
    field(page, "Map").select_option("Stage02")
    assert saved_config(page)["map"]["choice"] == "Stage02"
    field(page, "Map").select_option(label="random…")
    page.get_by_label("Remove all").click()
    page.get_by_label("Add to Maps to draw from").select_option("Stage01")
    page.get_by_label("Add to Maps to draw from").select_option("Stage03")
    config = saved_config(page)
    assert config["map"].get("choice") is None
    assert config["map"]["random_from"] == ["Stage01", "Stage03"]


def test_the_text_view_is_the_same_document(configure: Page) -> None:
    page = configure
    page.get_by_role("button", name="YAML", exact=True).click()
    text = page.get_by_label("Configuration as YAML")
    expect(text).to_have_value(re.compile("name: demo"))
    changed = re.sub(r"\bfps: \d+", "fps: 20", text.input_value())
    text.fill(changed)
    wait_until_saved_as(page, "fps", 20)
    text.fill(changed.replace("fps: 20", "fps: fast"))
    expect(page.locator(".yaml .field-error")).to_contain_text("fps")
    assert server_config(page)["fps"] == 20
    text.fill(changed)
    page.get_by_role("button", name="YAML", exact=True).click()
    expect(field(page, "Frame rate")).to_have_value("20")


def test_text_that_is_not_read_yet_is_not_saved_and_wrong_text_starts_nothing(
    configure: Page,
) -> None:
    page = configure
    start = page.get_by_role("button", name="Start", exact=True)
    held: list[Route] = []
    page.route("**/api/config/import", lambda route: held.append(route))
    page.get_by_role("button", name="YAML", exact=True).click()
    text = page.get_by_label("Configuration as YAML")
    expect(text).to_have_value(re.compile("name: demo"))
    changed = re.sub(r"\bfps: \d+", "fps: 25", text.input_value())
    text.fill(changed)
    expect(page.locator("[data-saved=saving]")).to_be_visible()
    # What is typed is read also when the text view has been left meanwhile.
    page.get_by_role("button", name="YAML", exact=True).click()
    while not held:
        page.wait_for_timeout(20)
    expect(page.locator("[data-saved=saving]")).to_be_visible()
    held[0].continue_()
    page.unroute("**/api/config/import")
    wait_until_saved_as(page, "fps", 25)

    page.get_by_role("button", name="YAML", exact=True).click()
    text.fill(changed.replace("fps: 25", "fps: fast"))
    expect(start).to_be_disabled()
    expect(page.get_by_role("status").filter(has_text="1 problem: fps")).to_be_visible()
    page.get_by_role("button", name="YAML", exact=True).click()
    expect(start).to_be_enabled()
    assert saved_config(page)["fps"] == 25


def test_files_come_back_as_they_went_out(configure: Page, tmp_path: Path) -> None:
    page = configure
    before = saved_config(page)
    page.get_by_role("button", name="File: configuration").click()
    with page.expect_download() as download:
        page.get_by_role("menuitem", name="Export YAML").click()
    kept = tmp_path / "kept.yaml"
    download.value.save_as(kept)
    field(page, "Seed").fill("99")
    assert saved_config(page)["seed"] == 99
    page.locator("input[aria-label='Configuration file']").set_input_files(kept)
    expect(field(page, "Seed")).to_have_value("7")
    assert saved_config(page) == before

    page.get_by_role("button", name="JSON: CARLA-style sensor list").click()
    with page.expect_download() as download:
        page.get_by_role("menuitem", name="Export a sensor list").click()
    sensors = tmp_path / "sensors.json"
    download.value.save_as(sensors)
    assert "sensor.camera.rgb" in sensors.read_text()
    page.locator("input[aria-label='Sensor list file']").set_input_files(sensors)
    wait_until_saved(page)
    assert len(saved_config(page)["rig"]["sensors"]) == 8


def test_two_pages_share_the_configuration(configure: Page, open_page: OpenPage) -> None:
    page, other = configure, open_page()
    expect(field(other, "Seed")).to_have_value("7")
    field(page, "Seed").fill("11")
    expect(field(other, "Seed")).to_have_value("11")
    # A wrong draft here, a change there: nobody's work is lost without being asked.
    field(other, "Episodes").fill("0")
    expect(other.locator("#field-episodes-error")).to_be_visible()
    field(page, "Seed").fill("12")
    expect(other.get_by_text("Another page has changed this configuration")).to_be_visible()
    other.get_by_role("button", name="Take theirs").click()
    expect(field(other, "Seed")).to_have_value("12")
    expect(field(other, "Episodes")).to_have_value("1")


def test_a_negative_number_among_alternatives_is_typed_key_by_key(configure: Page) -> None:
    page = configure
    search = page.get_by_label("Search the settings")
    search.fill("speed_difference_percent")
    try:
        slower = page.locator("input#field-traffic-speed_difference_percent")
        slower.fill("")
        expect(slower).to_have_value("")
        slower.press_sequentially("-20")
        expect(slower).to_have_value("-20")
        assert saved_config(page)["traffic"]["speed_difference_percent"] == -20
    finally:
        search.fill("")


def test_undo_where_no_setting_is_typed_leaves_the_configuration(configure: Page) -> None:
    page = configure
    seed = field(page, "Seed")
    seed.fill("99")
    wait_until_saved(page)
    for name in ("Search the settings", "Dataset folder"):
        other = page.get_by_label(name)
        before = other.input_value()
        other.press_sequentially("e")
        other.press("Control+z")
        expect(other).to_have_value(before)
        expect(seed).to_have_value("99")
    seed.press("Control+z")
    expect(seed).to_have_value("7")
