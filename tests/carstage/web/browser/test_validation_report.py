"""Validation and report in the page: findings lead to frame and sensor, pictures come first."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import expect

import analytic_dataset
from browser_pages import Gui, OpenPage

pytestmark = pytest.mark.xdist_group("browser")
JOB_MS = 90_000


@pytest.fixture(scope="module")
def gui(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gui]:
    """A server over a dataset that lacks one picture."""
    folder = tmp_path_factory.mktemp("verdict") / "datasets"
    folder.mkdir()
    dataset = analytic_dataset.make_dataset(folder / "scene", tmp_path_factory.mktemp("scene"))
    pictures = sorted((analytic_dataset.attempt_of(dataset) / "sensors" / "CAM_LEFT").iterdir())
    pictures[2].unlink()
    made = Gui(folder)
    made.start()
    try:
        yield made
    finally:
        made.stop()


def test_a_finding_leads_to_its_frame_and_sensor(open_page: OpenPage) -> None:
    page = open_page("#/datasets/scene?tab=validation")
    page.get_by_role("button", name="Validate").click()
    problems = page.get_by_role("region", name="Problems")
    problems.wait_for(timeout=JOB_MS)
    expect(page.locator(".validation").get_by_role("status")).to_contain_text("not valid")
    finding = problems.get_by_role("link", name="Episode 1, frame 2, CAM_LEFT").first
    finding.click()
    expect(page.get_by_role("slider", name="Frame")).to_have_value("2")
    shown = page.locator('.scene-cameras [data-sensor="CAM_LEFT"]')
    expect(shown).to_contain_text("no picture in this frame")
    page.go_back()
    expect(problems).to_be_visible()


@pytest.mark.parametrize(("width", "theme"), [(1440, "light"), (390, "dark")])
def test_the_report_is_read_in_the_page_and_begins_with_pictures(
    open_page: OpenPage, width: int, theme: str
) -> None:
    page = open_page("#/datasets/scene?tab=report", width=width, theme=theme)
    before = page.evaluate("fetch('api/datasets/scene/report').then((a) => a.json())")
    page.get_by_role("button", name="Write the report").or_(
        page.get_by_role("button", name="Write it again")
    ).click()
    newly_made = re.compile(rf"made=(?!{before.get('made') or 0}$)")
    expect(page.locator("iframe.report-page")).to_have_attribute("src", newly_made, timeout=JOB_MS)
    frame = page.frame_locator("iframe.report-page")
    expect(frame.get_by_role("heading", level=1)).to_have_text("analytic <scene>")
    first = frame.locator("img").first
    expect(first).to_have_attribute("alt", "CAM_FRONT with 3D boxes, frame 0, 0.0 s: 5 visible")
    box, tiles = first.bounding_box(), frame.locator(".tiles").bounding_box()
    assert box is not None
    assert tiles is not None
    assert box["y"] < tiles["y"]
    over = "document.querySelector('.content').scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(over) <= 0
    answer: dict[str, Any] = page.evaluate(
        "fetch('api/datasets/scene/report.html')"
        ".then((a) => ({policy: a.headers.get('content-security-policy')}))"
    )
    assert "default-src 'none'" in answer["policy"], "a dataset's words can start nothing"
