"""What the form says of a configuration before a run is started, and how it leads to a setting."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from browser_pages import (
    Gui,
    OpenPage,
    field,
    load_demo,
    picture,
    server_config,
    wait_until_saved,
)

pytestmark = pytest.mark.xdist_group("browser")


def test_a_dataset_that_holds_episodes_is_asked_about(open_page: OpenPage) -> None:
    page = open_page()
    load_demo(page)
    page.get_by_label("Dataset folder").fill("scene")
    expect(page.locator("#dataset-note")).to_contain_text("There already: 1 episode")
    page.get_by_role("button", name=re.compile("Start|Queue")).click()
    expect(page.locator(".ask")).to_contain_text("holds 1 episode already")
    page.locator(".ask").get_by_role("button", name="Cancel").click()
    expect(page.locator(".ask")).to_have_count(0)
    assert page.url.endswith("#/configure") or "#" not in page.url


def test_too_little_space_blocks_start_and_the_command_is_there(open_page: OpenPage) -> None:
    page = open_page()
    load_demo(page)
    estimate = page.locator(".estimate")
    expect(estimate).to_contain_text("needs", timeout=120_000)  # the simulator is asked first
    field(page, "Episodes").fill("100000")
    wait_until_saved(page)
    expect(estimate).to_contain_text("too little space")
    expect(page.get_by_role("button", name=re.compile("Start|Queue"))).to_be_disabled()
    field(page, "Episodes").fill("1")
    wait_until_saved(page)
    page.get_by_text("Workers, catalog, command").click()
    page.locator(".where").get_by_label("Workers").fill("auto")
    page.get_by_label("Dataset folder").fill("s3://bucket/drive")
    expect(page.locator("#dataset-note")).to_contain_text("an object store")
    page.get_by_role("button", name="Copy as command").click()
    expect(page.get_by_label("Command", exact=True)).to_contain_text(
        "carstage run - --out s3://bucket/drive --workers auto <<'CONFIG'"
    )


def test_two_sensors_of_one_name_are_told_apart(open_page: OpenPage) -> None:
    page = open_page()
    load_demo(page)
    rows = page.get_by_role("list", name="Sensors").get_by_role("button")
    count = rows.count()
    other = rows.nth(0).locator(".sensor-id").inner_text()
    rows.nth(1).click()
    name = page.locator(".inspector").get_by_role("textbox", name="Name")
    name.fill(other)
    expect(page.locator(".sensor-row[aria-pressed=true]")).to_have_count(1)
    expect(name).to_be_visible()
    expect(page.locator(".inspector .field-error").first).to_contain_text("used by")
    page.get_by_role("list", name="Problems").get_by_role("button").first.wait_for()
    name.blur()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(rows).to_have_count(count - 1)
    expect(rows.nth(0).locator(".sensor-id")).to_have_text(other)


def test_a_problem_leads_to_its_field(open_page: OpenPage) -> None:
    page = open_page()
    load_demo(page)
    field(page, "Episodes").fill("0")
    link = page.get_by_role("list", name="Problems").get_by_role("button", name="episodes")
    link.click()
    expect(field(page, "Episodes")).to_be_focused()


def test_another_server_has_no_maps_of_the_embedded_one(open_page: OpenPage) -> None:
    page = open_page()
    load_demo(page)
    groups = page.locator(".config-form h3")
    expect(groups.first).to_have_text("Server")
    expect(field(page, "Map")).to_have_js_property("tagName", "SELECT")
    page.get_by_role("group", name="Server").get_by_role("button", name="remote").or_(
        page.locator("#field-server")
    ).first.wait_for()
    page.evaluate(
        """async () => {
          const state = await (await fetch('api/config')).json();
          const config = {...state.config, server: {kind: 'remote', host: '127.0.0.1', port: 2999}};
          await fetch('api/config', {method: 'PUT', headers: {'Content-Type': 'application/json'},
            body: JSON.stringify({rev: state.rev, config, author: 'test'})});
        }"""
    )
    expect(field(page, "Map")).to_have_js_property("tagName", "INPUT")
    expect(page.get_by_text("Maps and vehicles are those of your server")).to_be_visible()
    field(page, "Map").fill("Town10HD_Opt")
    wait_until_saved(page)
    assert server_config(page)["map"]["choice"] == "Town10HD_Opt"


def test_settings_are_searched_and_told_from_the_usual_ones(open_page: OpenPage, gui: Gui) -> None:
    page = open_page()
    load_demo(page)
    form = page.locator(".config-form")
    page.get_by_label("Search the settings").fill("hang")
    expect(form.locator(".field")).not_to_have_count(0)
    expect(form).not_to_contain_text("Episodes")
    page.get_by_label("Search the settings").fill("")
    page.get_by_role("button", name="Paper", exact=True).click()
    for name in ("Map", "Weather", "Episodes", "Duration", "Frame rate", "Image size",
                 "Maximum distance", "Ground truth", "Timing"):  # fmt: skip
        expect(form).to_contain_text(re.compile(name, re.IGNORECASE))
    picture(page, "gui-paper.png", gui)
    page.get_by_role("button", name="Changed", exact=True).click()
    field(page, "Name").first.wait_for()
