"""Click to place, align and distribute, another rig beside this one, calibrations of others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from browser_pages import field, saved_config, wait_until

pytestmark = pytest.mark.xdist_group("browser")


def ids(page: Page) -> list[str]:
    return [sensor["id"] for sensor in saved_config(page)["rig"]["sensors"]]


def arm(page: Page, kind: str) -> None:
    toggle = page.get_by_role("button", name="Place by click")
    if toggle.get_attribute("aria-pressed") != "true":
        toggle.click()
    page.get_by_role("button", name=kind, exact=True).click()
    page.locator(".view-top .placing-ground").wait_for()


def disarm(page: Page) -> None:
    toggle = page.get_by_role("button", name="Place by click")
    if toggle.get_attribute("aria-pressed") == "true":
        toggle.click()


def test_a_ghost_snaps_to_a_usual_place_and_a_click_puts_the_sensor_there(configure: Page) -> None:
    page = configure
    page.locator(".view-top .car-body").first.wait_for()
    before = ids(page)
    arm(page, "Camera")
    place = page.locator(".view-top .mount-place").last.bounding_box()
    assert place is not None
    at = (place["x"] + place["width"] / 2 + 4, place["y"] + place["height"] / 2 + 3)
    page.mouse.move(*at)
    expect(page.locator(".view-top .ghost")).to_have_attribute("data-mount", "Rear bumper")
    page.mouse.click(*at)
    added = [name for name in ids(page) if name not in before]
    assert len(added) == 1
    sensor = next(s for s in saved_config(page)["rig"]["sensors"] if s["id"] == added[0])
    assert sensor["pose"]["yaw_deg"] == 180
    assert sensor["pose"]["z"] == 0.55
    expect(page.locator(".placing")).to_have_count(0)
    expect(page.locator("#pose-z")).to_have_value("0.55")
    disarm(page)


def test_with_shift_several_are_placed_and_escape_ends_it(configure: Page) -> None:
    page = configure
    before = ids(page)
    arm(page, "Radar")
    box = page.locator(".view-side .placing-ground").bounding_box()
    assert box is not None
    page.keyboard.down("Shift")
    for share in (0.2, 0.8):
        page.mouse.click(box["x"] + box["width"] * share, box["y"] + box["height"] * 0.15)
    page.keyboard.up("Shift")
    assert len(ids(page)) == len(before) + 2
    page.get_by_role("heading", name="Sensor rig").click()
    page.get_by_role("button", name="Radar", exact=True).focus()
    page.keyboard.press("Escape")
    expect(page.locator(".placing")).to_have_count(0)
    disarm(page)


def test_a_press_on_the_car_in_3d_places_a_sensor(configure: Page) -> None:
    page = configure
    page.locator(".scene-host[data-ready=true] canvas").wait_for()
    wait_until(page, "window.carstage3d && carstage3d.drawn() > 0")
    before = ids(page)
    arm(page, "LiDAR")
    x, y = page.evaluate("carstage3d.project(1.6, 0.6, 0.9)")
    page.locator(".view-3d canvas").click(position={"x": x, "y": y})
    added = [name for name in ids(page) if name not in before]
    assert len(added) == 1
    sensor = next(s for s in saved_config(page)["rig"]["sensors"] if s["id"] == added[0])
    assert 0.5 < sensor["pose"]["x"] < 2.6, "on the bonnet, not in the air"
    disarm(page)


def test_what_is_chosen_is_aligned_and_distributed_in_one_step_back(configure: Page) -> None:
    page = configure
    rows = page.get_by_role("list", name="Sensors")
    rows.get_by_role("button", name="CAM_FRONT").click()
    for name in ("CAM_LEFT", "LIDAR_TOP"):
        rows.get_by_role("button", name=name).click(modifiers=["Shift"])

    def poses() -> list[dict[str, float]]:
        sensors = {s["id"]: s.get("pose", {}) for s in saved_config(page)["rig"]["sensors"]}
        return [sensors[name] for name in ("CAM_FRONT", "CAM_LEFT", "LIDAR_TOP")]

    was = poses()
    page.get_by_role("button", name="Arrange: what is chosen").click()
    page.get_by_role("menuitem", name="Align along x").click()
    assert {pose.get("x", 0) for pose in poses()} == {was[0]["x"]}
    page.get_by_role("button", name="Arrange: what is chosen").click()
    page.get_by_role("menuitem", name="Turn all around evenly").click()
    assert sorted(pose.get("yaw_deg", 0) for pose in poses()) == [-120, 0, 120]
    page.get_by_role("heading", name="Sensor rig").click()
    for _ in range(2):
        page.keyboard.press("Control+z")
    assert poses() == was


def test_another_rig_stands_beside_this_one(configure: Page) -> None:
    page = configure
    page.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_label("Rig to compare with").select_option("nuscenes")
    table = page.get_by_role("region", name="Differences of the rigs")
    row = table.locator("tr", has_text="Camera (RGB)")
    expect(row.locator("td").last).to_have_text("6")
    expect(table.locator("tr", has_text="Seen by cameras").locator("td").last).to_have_text("360°")
    marks = page.get_by_label("Other rig, top view").locator("[data-sensor]")
    expect(marks.first).to_be_attached()
    before = ids(page)
    page.get_by_role("button", name="Compare", exact=True).click()
    assert ids(page) == before


def test_a_calibration_is_imported_and_says_what_it_lacks(configure: Page, tmp_path: Path) -> None:
    page = configure
    before = ids(page)
    info = {
        "image_width": 640, "image_height": 480, "camera_name": "ros_cam",
        "camera_matrix": {"data": [320, 0, 320, 0, 320, 240, 0, 0, 1]},
    }  # fmt: skip
    path = tmp_path / "ros.yaml"
    path.write_text(json.dumps(info))
    page.get_by_label("Calibration files").set_input_files(path)
    told = page.get_by_role("status", name="What the import says")
    expect(told).to_contain_text("no pose")
    told.get_by_role("button", name="Close").click()
    assert ids(page) == [*before, "ros_cam"]
    page.get_by_role("list", name="Sensors").get_by_role("button", name="ros_cam").click()
    expect(field(page, "Field of view")).to_have_value("90")
