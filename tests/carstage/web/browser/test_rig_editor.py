"""Placing sensors: with the mouse, the gizmo, the keyboard, and by number."""

from __future__ import annotations

import math
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from browser_pages import OpenPage, field, saved_config, wait_until, wait_until_saved

pytestmark = pytest.mark.xdist_group("browser")


def mark(page: Page, view: str, sensor: str) -> Locator:
    return page.get_by_label(f"{view} view", exact=True).locator(f'[data-sensor="{sensor}"]')


def scale(page: Page, view: str) -> float:
    """Pixels per metre of a view."""
    plan = page.get_by_label(f"{view} view", exact=True).locator(".plan")
    return float(plan.get_attribute("data-scale") or "nan")


def middle(place: Locator) -> tuple[float, float]:
    box = place.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page: Page, start: tuple[float, float], by: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    for step in range(1, 6):
        page.mouse.move(start[0] + by[0] * step / 5, start[1] + by[1] * step / 5)
    page.mouse.up()


def choose(page: Page, sensor: str) -> None:
    page.get_by_role("list", name="Sensors").get_by_role("button", name=sensor).click()


def sensor(page: Page, name: str) -> dict[str, Any]:
    sensors: list[dict[str, Any]] = saved_config(page)["rig"]["sensors"]
    return next(one for one in sensors if one["id"] == name)


def pose(page: Page, name: str) -> dict[str, float]:
    keys = ("x", "y", "z", "roll_deg", "pitch_deg", "yaw_deg")
    return {**dict.fromkeys(keys, 0.0), **sensor(page, name).get("pose", {})}


def test_a_drag_in_the_top_view_moves_a_sensor_by_snapped_metres(configure: Page) -> None:
    page = configure
    metre = scale(page, "Top")
    drag(page, middle(mark(page, "Top", "CAM_LEFT")), (-0.3 * metre, -0.51 * metre))
    moved = pose(page, "CAM_LEFT")
    assert (moved["x"], moved["y"], moved["z"]) == (1.5, -0.7, 1.6)
    page.keyboard.press("Control+z")
    assert pose(page, "CAM_LEFT")["x"] == 1.0, "a whole drag is one step back"
    page.keyboard.press("Control+Shift+z")
    assert pose(page, "CAM_LEFT")["x"] == 1.5


def test_sensors_in_one_place_are_dragged_together(configure: Page) -> None:
    page = configure
    metre = scale(page, "Side")
    drag(page, middle(mark(page, "Side", "CAM_FRONT")), (0.0, -0.4 * metre))
    heights = {pose(page, name)["z"] for name in ("CAM_FRONT", "DEPTH_FRONT", "SEMANTIC_FRONT")}
    assert heights == {2.0}
    assert pose(page, "CAM_LEFT")["z"] == 1.6


def test_the_handle_turns_in_steps_of_five_degrees(configure: Page) -> None:
    page = configure
    choose(page, "CAM_LEFT")
    handle = page.get_by_label("Top view", exact=True).locator('[data-handle="CAM_LEFT"]')
    center, at = middle(mark(page, "Top", "CAM_LEFT")), middle(handle)
    radius = math.dist(center, at)
    goal = (
        center[0] - radius * math.sin(math.radians(31)),
        center[1] - radius * math.cos(math.radians(31)),
    )
    drag(page, at, (goal[0] - at[0], goal[1] - at[1]))
    assert pose(page, "CAM_LEFT")["yaw_deg"] == -30


def test_the_keyboard_reaches_a_sensor_and_nudges_it(configure: Page) -> None:
    page = configure
    one = mark(page, "Top", "CAM_LEFT")
    one.focus()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("]")
    moved = pose(page, "CAM_LEFT")
    assert moved["x"] == pytest.approx(1.05)
    assert moved["y"] == pytest.approx(-0.39)
    assert moved["yaw_deg"] == -55
    page.keyboard.press("Control+d")
    expect(page.get_by_role("list", name="Sensors").get_by_role("button")).to_have_count(9)
    page.keyboard.press("Delete")
    expect(page.get_by_role("list", name="Sensors").get_by_role("button")).to_have_count(8)
    assert sensor(page, "CAM_LEFT")


def test_the_gizmo_moves_a_sensor_up(configure: Page) -> None:
    page = configure
    choose(page, "LIDAR_TOP")
    canvas = page.locator(".scene-host[data-ready=true] canvas")
    canvas.wait_for()
    wait_until(page, "window.carstage3d && window.carstage3d.drawn() > 0")
    box = canvas.bounding_box()
    assert box is not None
    foot = page.evaluate("window.carstage3d.project(0, 0, 1.9)")
    # The arrow along z begins a little above the sensor.
    high = page.evaluate("window.carstage3d.project(0, 0, 2.9)")
    length = math.dist(foot, high)
    up = ((high[0] - foot[0]) / length, (high[1] - foot[1]) / length)
    grip = (box["x"] + foot[0] + up[0] * 42, box["y"] + foot[1] + up[1] * 42)
    page.mouse.move(*grip)
    page.wait_for_timeout(200)
    drag(page, grip, (up[0] * length * 0.5, up[1] * length * 0.5))
    moved = pose(page, "LIDAR_TOP")
    assert (moved["x"], moved["y"]) == (0, 0)
    assert moved["z"] == pytest.approx(2.4, abs=0.2)
    assert round(moved["z"] / 0.05, 6) == round(moved["z"] / 0.05), "snaps to 5 cm"
    page.keyboard.press("Control+z")
    assert pose(page, "LIDAR_TOP")["z"] == 1.9


def test_the_3d_view_draws_only_when_something_changes(configure: Page) -> None:
    page = configure
    page.locator(".scene-host[data-ready=true]").wait_for()
    page.wait_for_timeout(700)
    before = page.evaluate("window.carstage3d.drawn()")
    page.wait_for_timeout(700)
    assert page.evaluate("window.carstage3d.drawn()") == before
    choose(page, "CAM_LEFT")
    wait_until(page, f"window.carstage3d.drawn() > {before}")


def test_mirror_add_and_mount_points(configure: Page) -> None:
    page = configure
    choose(page, "CAM_LEFT")
    page.get_by_role("button", name="Mirror left-right").click()
    mirrored = pose(page, "CAM_RIGHT")
    assert (mirrored["y"], mirrored["yaw_deg"]) == (0.4, 60)
    page.get_by_role("button", name="Radar", exact=True).click()
    field(page, "Mount point").select_option("Rear bumper")
    at = pose(page, "RADAR")
    assert at["yaw_deg"] == 180
    assert at["x"] == pytest.approx(-2.37, abs=0.02), "the Model 3's rear"
    field(page, "Horizontal field of view").fill("70")
    assert sensor(page, "RADAR")["attributes"]["horizontal_fov_deg"] == 70


def test_a_preset_is_shown_and_written_out_when_it_is_changed(configure: Page) -> None:
    page = configure
    page.get_by_label("Rig preset").select_option("nuscenes")
    expect(page.get_by_role("list", name="Sensors").get_by_role("button")).to_have_count(14)
    assert saved_config(page)["rig"]["preset"] == "nuscenes"
    choose(page, "CAM_BACK_LEFT")
    page.locator("#pose-z").fill("1.8")
    config = saved_config(page)
    assert config["rig"].get("preset") is None
    assert len(config["rig"]["sensors"]) == 14
    assert pose(page, "CAM_BACK_LEFT")["z"] == 1.8
    page.get_by_role("button", name="Undo").click()
    assert saved_config(page)["rig"]["preset"] == "nuscenes"


def test_coverage_says_how_much_nobody_sees(configure: Page) -> None:
    page = configure
    page.get_by_label("Coverage of the ground").select_option("camera")
    cameras = page.locator(".coverage-share b").inner_text()
    page.get_by_label("Coverage of the ground").select_option("all")
    everything = page.locator(".coverage-share b").inner_text()
    assert int(everything.split()[0]) < int(cameras.split()[0])


def test_another_rig_beside_this_one_lies_over_nothing_on_a_low_screen(
    open_page: OpenPage,
) -> None:
    page = open_page("#/configure", width=1024, height=768)
    page.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_label("Other rig, top view", exact=True).locator(".plan").wait_for()
    for view in ("Top view", "3D view", "Side view"):
        box = page.get_by_label(view, exact=True).bounding_box()
        assert box is not None
        assert box["height"] > 100, view
    covered = page.get_by_role("heading", name="Sensors", exact=True).evaluate(
        """(heading) => {
          const box = heading.getBoundingClientRect();
          const at = (x) => document.elementFromPoint(x, box.top + box.height / 2);
          return [0, 40, 80, 120].map((x) => at(box.left + x).closest('.sensors') === null);
        }"""
    )
    assert covered == [False] * 4


def test_the_outline_is_the_chosen_vehicle_s(configure: Page) -> None:
    page = configure
    body = page.get_by_label("Side view", exact=True).locator(".car-body").first
    car = body.get_attribute("d")
    field(page, "Ego vehicle").select_option("vehicle.mitsubishi.fusorosa")
    wait_until_saved(page)
    expect(body).not_to_have_attribute("d", car or "")


def test_a_sensor_of_a_preset_is_previewed(configure: Page) -> None:
    page = configure
    asked: list[dict[str, Any]] = []

    def preview(route: Route) -> None:
        asked.append(route.request.post_data_json)
        route.fulfill(status=202, json={"state": "starting"})

    page.route("**/api/preview/warm", lambda route: route.fulfill(json={}))
    page.route("**/api/preview", preview)
    try:
        page.get_by_label("Rig preset").select_option("nuscenes")
        choose(page, "CAM_BACK_LEFT")
        page.get_by_role("button", name="Preview through this sensor").click()
        while not asked:
            page.wait_for_timeout(50)
        assert asked[0]["sensor"]["id"] == "CAM_BACK_LEFT"
        page.locator(".sensor-preview").get_by_role("button", name="Close").click()
    finally:
        page.unroute("**/api/preview/warm")
        page.unroute("**/api/preview")


def test_a_sensor_added_to_a_preset_gets_a_name_of_its_own(configure: Page) -> None:
    page = configure
    page.get_by_label("Rig preset").select_option("nuscenes")
    listed = page.get_by_role("list", name="Sensors").get_by_role("button")
    expect(listed).to_have_count(14)
    page.get_by_role("button", name="More: other kinds of sensor").click()
    page.get_by_role("menuitem", name="IMU").click()
    expect(listed).to_have_count(15)
    rig = saved_config(page)["rig"]
    ids = [one["id"] for one in rig["sensors"]]
    assert rig.get("preset") is None
    assert len({one.lower() for one in ids}) == 15
    expect(page.locator(".inspector-head strong")).to_have_text(ids[-1])
