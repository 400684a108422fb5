"""Start, route and weather on the map: by presses and by keys, in step with form and text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from axe_checks import ALL_RULES, AXE, settle, violations
from browser_pages import PICTURES, OpenPage, field, load_demo, saved_config

pytestmark = pytest.mark.xdist_group("browser")


@pytest.fixture
def town(configure: Page) -> Page:
    """The demonstration's map, with its spawn points."""
    show_map(configure)
    return configure


def show_map(page: Page) -> None:
    page.get_by_role("button", name="Map", exact=True).click()
    page.locator(".spawn-points").and_(page.locator("[data-count='214']")).wait_for(
        state="attached"
    )


@pytest.fixture(autouse=True)
def back_to_the_rig(shared_page: Page) -> Iterator[None]:
    """Other tests begin beside the rig."""
    yield
    page = shared_page
    back = page.get_by_role("button", name="Rig", exact=True)
    if back.count() > 0:
        back.click()


def spawn_points(page: Page) -> list[list[float]]:
    answer: dict[str, Any] = page.evaluate(
        "fetch('api/map', {method: 'POST', headers: {'Content-Type': 'application/json'}, "
        "body: JSON.stringify({server: {kind: 'embedded'}, map: 'Stage01'})}).then((a) => a.json())"
    )
    points: list[list[float]] = answer["spawn_points"]
    return points


def screen_of(page: Page, x: float, y: float) -> tuple[float, float]:
    """Where a place of the map is drawn."""
    at = page.locator(".town-map .plan g.no-pointer").evaluate(
        "(group, [x, y]) => { const p = new DOMPoint(x, y).matrixTransform(group.getScreenCTM()); "
        "return [p.x, p.y]; }",
        [x, y],
    )
    return at[0], at[1]


def press(page: Page, x: float, y: float) -> None:
    page.mouse.click(*screen_of(page, x, y))


def test_a_press_on_an_arrow_is_the_start_and_undo_takes_it_back(town: Page) -> None:
    page = town
    before = saved_config(page)["ego"]["spawn"]
    press(page, *spawn_points(page)[7][:2])
    expect(page.get_by_role("combobox", name="Start of the ego")).to_have_value("7")
    assert saved_config(page)["ego"]["spawn"] == 7
    expect(page.locator("[data-start]")).to_be_attached()
    expect(page.locator("[data-within]")).to_have_count(2)
    page.get_by_role("button", name="YAML", exact=True).click()
    expect(page.get_by_label("Configuration as YAML")).to_have_value(re.compile("spawn: 7"))
    page.get_by_role("button", name="YAML", exact=True).click()
    page.get_by_role("button", name="Undo").click()
    assert saved_config(page)["ego"]["spawn"] == before
    page.get_by_role("button", name="Redo").click()
    assert saved_config(page)["ego"]["spawn"] == 7


def test_a_press_on_a_road_is_a_place_above_it_and_beside_it_nothing(town: Page) -> None:
    page = town
    points = spawn_points(page)
    page.get_by_role("button", name="Zoom in, map").click(click_count=4)
    # On the lane, ahead of a spawn point, where no other one is near.
    x, y, z, yaw = next(
        p
        for p in points
        if p[3] in (0.0, 90.0, -90.0, -180.0)
        and abs(p[0]) < 60
        and abs(p[1]) < 40
        and all(abs(q[0] - p[0]) + abs(q[1] - p[1]) > 12 or q is p for q in points)
    )
    ahead = {0.0: (6, 0), 90.0: (0, 6), -90.0: (0, -6), -180.0: (-6, 0)}[yaw]
    press(page, x + ahead[0], y + ahead[1])
    start = saved_config(page)["ego"]["spawn"]
    assert start["x"] == pytest.approx(x + ahead[0], abs=1.0)
    assert start["y"] == pytest.approx(y + ahead[1], abs=1.0)
    assert start["z"] == pytest.approx(z, abs=0.4)
    assert (start["yaw_deg"] - yaw) % 360 == pytest.approx(0, abs=2.0)
    page.get_by_role("button", name="Fit, map").click()
    box = page.locator(".town-map .ground").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 3, box["y"] + 3)
    expect(page.get_by_text("No road is there.")).to_be_visible()
    assert saved_config(page)["ego"]["spawn"] == start


def test_a_route_is_pressed_put_in_order_and_cleared(town: Page) -> None:
    page = town
    points = spawn_points(page)
    page.get_by_role("button", name="Set route").click()
    for number in (20, 5):
        press(page, *points[number][:2])
    page.get_by_label("Add a spawn point to the route").select_option("9")
    route = {"kind": "route", "through": [20, 5, 9], "events": []}
    assert saved_config(page)["scenario"] == route
    expect(page.locator("[data-stop]")).to_have_count(3)
    page.get_by_role("button", name="Earlier, place 3").click()
    page.get_by_role("button", name="Remove place 1").click()
    assert saved_config(page)["scenario"]["through"] == [9, 5]
    expect(field(page, "Scenario")).to_have_value("route")
    page.get_by_role("button", name="Clear").click()
    assert saved_config(page)["scenario"]["kind"] == "autopilot"


def test_spawn_points_are_reached_by_keys_alone(town: Page) -> None:
    page = town
    page.get_by_role("application").focus()
    page.keyboard.press("ArrowLeft")
    cursor = page.locator("[data-cursor]")
    first = int(cursor.get_attribute("data-cursor") or -1)
    page.keyboard.press("ArrowLeft")
    second = int(cursor.get_attribute("data-cursor") or -1)
    points = spawn_points(page)
    assert points[second][0] < points[first][0], "further to the left"
    expect(page.get_by_role("status").filter(has_text=f"Spawn point {second}")).to_be_visible()
    page.keyboard.press("Enter")
    assert saved_config(page)["ego"]["spawn"] == second


def test_the_weather_is_a_timeline(town: Page) -> None:
    page = town
    bar = page.locator(".weather-bar")
    box = bar.bounding_box()
    assert box is not None
    duration = saved_config(page)["duration_s"]
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.get_by_label("Change 1: weather").select_option("HardRainNoon")
    (change,) = saved_config(page)["weather"]["changes"]
    assert change["choice"] == "HardRainNoon"
    assert change["at_s"] == pytest.approx(duration / 2, abs=0.11)
    mark = page.get_by_role("slider", name="Change 1")
    mark.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    moved = saved_config(page)["weather"]["changes"][0]["at_s"]
    assert moved == pytest.approx(change["at_s"] + 1.1)
    at = mark.bounding_box()
    assert at is not None
    page.mouse.move(at["x"] + at["width"] / 2, at["y"] + 16)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.3, at["y"] + 16, steps=5)
    page.mouse.up()
    dragged = saved_config(page)["weather"]["changes"][0]["at_s"]
    assert dragged == pytest.approx(0.3 * duration, abs=0.11)
    page.get_by_role("button", name="Undo").click()
    assert saved_config(page)["weather"]["changes"][0]["at_s"] == pytest.approx(moved)
    page.get_by_label("Change 1: at second").fill("-1")
    expect(page.get_by_role("list", name="Weather by time")).to_contain_text("too small")
    page.get_by_role("button", name="Remove change 1").click()
    assert saved_config(page)["weather"]["changes"] == []


def test_what_a_replay_ignores_cannot_be_set(town: Page) -> None:
    page = town
    field(page, "Scenario").select_option("replay")
    expect(page.get_by_role("complementary", name="Places")).to_contain_text("played again")
    expect(page.get_by_role("button", name="Set start")).to_be_disabled()
    expect(page.get_by_label("Start of the ego")).to_have_count(0)


def test_of_a_server_that_cannot_be_asked_the_map_says_so(town: Page) -> None:
    page = town
    field(page, "Server").select_option("remote")
    expect(page.locator(".town-map .view-note")).to_contain_text("127.0.0.1:2000")
    expect(page.locator(".town-map .lane")).to_have_count(0)


@pytest.mark.parametrize(
    ("width", "height", "theme"),
    [(1440, 900, "dark"), (1024, 768, "light"), (768, 1024, "dark"), (390, 844, "light")],
)
def test_on_every_screen_the_map_is_whole_and_accessible(
    open_page: OpenPage, width: int, height: int, theme: str
) -> None:
    page = open_page("#/configure", width=width, height=height, theme=theme)
    load_demo(page)
    show_map(page)
    page.get_by_label("Start of the ego").select_option("7")
    page.get_by_role("button", name="Set route").click()
    for number in ("20", "5"):
        page.get_by_label("Add a spawn point to the route").select_option(number)
    page.get_by_role("button", name="Add a change").click()
    settle(page)
    config = saved_config(page)
    assert config["scenario"]["through"] == [20, 5]
    over = page.evaluate(
        "document.querySelector('.content').scrollWidth - document.documentElement.clientWidth"
    )
    assert over <= 0
    canvas = page.locator(".town-map .plan").bounding_box()
    assert canvas is not None
    assert canvas["height"] >= 200
    page.get_by_label("Change 1: weather").select_option("HardRainNoon")
    if PICTURES and width == 1440:
        page.screenshot(path=Path(PICTURES) / "gui-map.png")
    if AXE.exists():
        page.evaluate(AXE.read_text())
        assert violations(page, ALL_RULES) == []
