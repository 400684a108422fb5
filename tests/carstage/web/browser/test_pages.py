"""What holds for every page: accessible, small, usable on small screens, nothing stale."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Page, expect

import golden_poses
from axe_checks import ALL_RULES, AXE, COLOUR_RULES, settle, violations
from benchmarks.framework.gui.bundle import BUNDLE_BYTES, compressed_bytes
from browser_pages import OpenPage, load_demo, wait_until_saved

pytestmark = pytest.mark.xdist_group("browser")


def episode_address(page: Page) -> str:
    answer: dict[str, Any] = page.evaluate("fetch('api/datasets/scene').then((a) => a.json())")
    return f"#/datasets/scene/{answer['episodes'][0]['episode_id']}"


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_no_violation_of_level_a_or_aa(open_page: OpenPage, theme: str) -> None:
    if not AXE.exists():
        pytest.skip("no axe-core: npm ci in ui/")
    page = open_page("#/configure", theme=theme)
    episode = episode_address(page)
    source = AXE.read_text()
    found: dict[str, list[str]] = {}

    def look(name: str) -> None:
        settle(page)
        if wrong := violations(page, ALL_RULES if theme == "light" else COLOUR_RULES):
            found[name] = wrong

    page.evaluate(source)
    page.get_by_role("list", name="Sensors").get_by_role("button").first.click()
    look("configure")
    page.get_by_role("button", name="YAML", exact=True).click()
    look("yaml")
    for address in ("#/run", "#/runs", "#/datasets/scene", episode):
        page.evaluate(f"location.hash = '{address}'")
        look(address)
        for tab in page.get_by_role("tab").all():
            tab.click()
            look(f"{address} {tab.inner_text()}")
    assert not found, "\n".join(line for lines in found.values() for line in lines)


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (820, 1180)])
def test_no_page_is_wider_than_the_screen(open_page: OpenPage, width: int, height: int) -> None:
    page = open_page("#/configure", width=width, height=height)
    for address in ("#/configure", "#/run", "#/datasets/scene", episode_address(page)):
        page.evaluate(f"location.hash = '{address}'")
        settle(page)
        over = page.evaluate(
            "document.querySelector('.content').scrollWidth - document.documentElement.clientWidth"
        )
        assert over <= 0, address
    if width >= 1280:
        page.evaluate("location.hash = '#/configure'")
        form, rig = page.get_by_label("Parameters", exact=True), page.get_by_label("Sensor rig")
        expect(form).to_be_visible()
        left, right = form.bounding_box(), rig.bounding_box()
        assert left is not None
        assert right is not None
        assert left["x"] + left["width"] <= right["x"], "parameters and rig stand side by side"
        assert right["y"] + right["height"] <= height, "and both fit on the screen"


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_pages_are_scrolled_below_the_bar_alone(
    open_page: OpenPage, width: int, height: int
) -> None:
    page = open_page("#/configure", width=width, height=height)
    for address in ("#/configure", "#/run", "#/datasets/scene", episode_address(page)):
        page.evaluate(f"location.hash = '{address}'")
        settle(page)
        page.locator(".content > *").first.wait_for()
        over = page.evaluate(
            "document.documentElement.scrollHeight - document.documentElement.clientHeight"
        )
        assert over <= 0, address


def test_at_1440_px_the_toolbar_is_one_row_and_no_name_of_a_setting_is_cut(
    open_page: OpenPage,
) -> None:
    page = open_page("#/configure")
    page.get_by_role("list", name="Sensors").get_by_role("button", name="LIDAR_TOP").click()
    middles = page.locator(".toolbar .button, .toolbar select").evaluate_all(
        "(all) => all.map((one) => one.getBoundingClientRect())"
        ".map((box) => Math.round(box.top + box.height / 2))"
    )
    assert max(middles) - min(middles) <= 1  # menus are a little higher than buttons
    cut = page.locator(".inspector .field-title").evaluate_all(
        "(all) => all.filter((one) => one.scrollWidth > one.clientWidth + 1)"
        ".map((one) => one.textContent)"
    )
    assert cut == []


def test_scripts_and_styles_are_small_and_3d_comes_later(open_page: OpenPage) -> None:
    sizes = compressed_bytes()
    assert sum(sizes.values()) <= BUNDLE_BYTES, sizes
    page = open_page("#/run")
    settle(page)
    loaded = page.evaluate("performance.getEntriesByType('resource').map((one) => one.name)")
    heavy = max(sizes, key=lambda name: sizes[name])
    assert not any(name.endswith(heavy) for name in loaded), "three.js only where 3D is shown"


NO_WEBGL = """
const usual = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith('webgl') ? null : usual.call(this, kind, ...more);
};
"""


def test_without_webgl_sensors_are_placed_and_episodes_looked_through(open_page: OpenPage) -> None:
    page = open_page("#/configure", script=NO_WEBGL)
    expect(page.get_by_label("3D view", exact=True)).to_contain_text("no WebGL")
    load_demo(page)
    page.locator('.view-top [data-sensor="CAM_LEFT"]').focus()
    page.keyboard.press("ArrowUp")
    wait_until_saved(page)
    expect(page.locator("#pose-x")).to_have_value("1.05")
    page.evaluate(f"location.hash = '{episode_address(page)}'")
    expect(page.get_by_label("Points in 3D")).to_contain_text("no WebGL")
    page.get_by_role("button", name="Frame forward").click()
    expect(page.locator(".scene-cameras .camera")).to_have_attribute("data-k", "1")


def test_golden_poses_are_those_of_python() -> None:
    assert golden_poses.GOLDEN.read_text() == golden_poses.text()


@pytest.mark.parametrize(("width", "theme"), [(1440, "dark"), (390, "light")])
def test_headings_of_the_dataset_pages_are_in_order(
    open_page: OpenPage, width: int, theme: str
) -> None:
    if not AXE.exists():
        pytest.skip("no axe-core: npm ci in ui/")
    page = open_page("#/datasets/scene", width=width, theme=theme)
    addresses = ["#/datasets/scene", episode_address(page)]
    page.evaluate(AXE.read_text())
    found: list[str] = []
    for address in addresses:
        page.evaluate(f"location.hash = '{address}'")
        settle(page)
        for tab in page.get_by_role("tab").all() or [None]:
            if tab is not None:
                tab.click()
                settle(page)
            rules = ["heading-order", "page-has-heading-one", "color-contrast", "empty-heading"]
            found += violations(page, {"type": "rule", "values": rules})
    assert found == []
