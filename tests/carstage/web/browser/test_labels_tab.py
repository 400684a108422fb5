"""The Labels tab: classes, units, legend, the way to a frame, all of it in the address."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from browser_pages import OpenPage

pytestmark = pytest.mark.xdist_group("browser")


def open_labels(open_page: OpenPage, query: str = "?tab=labels") -> Page:
    page = open_page(f"#/datasets/scene{query}")
    page.locator(".label-table tbody tr").first.wait_for()
    return page


def headings(page: Page) -> list[str]:
    names = [th.inner_text() for th in page.locator(".label-table th").all()]
    return [" ".join(name.split()) for name in names]


def test_rows_have_a_class_and_columns_their_units(open_page: OpenPage) -> None:
    page = open_labels(open_page)
    names = headings(page)
    assert "class" in names
    assert "distance from camera m" in names
    classes = page.locator(".label-table td .class-name").all_inner_texts()
    assert set(classes) <= {"car", "truck", "walker_adult", "traffic_light"}
    assert classes
    page.get_by_role("button", name="Objects", exact=True).click()
    page.locator(".label-table th", has_text="distance from ego").wait_for()
    assert {"class", "LiDAR points", "distance from ego m"} <= set(headings(page))
    page.get_by_text("What the columns mean").click()
    expect(page.locator(".meanings")).to_contain_text("ego pivot to box centre")


def test_the_legend_counts_classes_and_shows_one_of_them(open_page: OpenPage) -> None:
    page = open_labels(open_page)
    legend = page.get_by_role("group", name="Classes")
    car = legend.get_by_role("button", name=re.compile("^car"))
    count = re.search(r"\d+", car.inner_text())
    assert count is not None
    car.click()
    expect(page.locator(".table-tools .muted")).to_contain_text(f"of {count[0]}")
    assert set(page.locator(".label-table td .class-name").all_inner_texts()) == {"car"}
    expect(legend.get_by_role("button")).not_to_have_count(1)


def test_tab_filters_and_order_outlive_a_reload_and_a_step_back(open_page: OpenPage) -> None:
    page = open_labels(open_page)
    shown = page.locator(".table-tools .muted")
    expect(shown).to_contain_text("of")
    unfiltered = shown.inner_text()
    page.get_by_role("button", name="Filter").click()
    page.get_by_label("Column of filter 1").select_option("distance")
    page.get_by_label("Value of filter 1").fill("20")
    page.get_by_role("button", name=re.compile("^distance from camera")).click()
    expect(page.locator("th[aria-sort=ascending]")).to_contain_text("distance")
    expect(shown).not_to_have_text(unfiltered)
    total = shown.inner_text()
    page.reload()
    expect(page.get_by_label("Value of filter 1")).to_have_value("20")
    expect(shown).to_have_text(total)
    expect(page.locator("th[aria-sort=ascending]")).to_contain_text("distance")
    page.get_by_role("tab", name="Statistics").click()
    page.go_back()
    expect(page.get_by_label("Value of filter 1")).to_have_value("20")


def test_a_row_opens_its_frame_with_its_object(open_page: OpenPage) -> None:
    page = open_labels(open_page, "?tab=labels&filter=k~eq~1")
    row = page.locator(".label-table tbody tr").first
    track = (row.locator("td[title^=track]").get_attribute("title") or "").split()[-1]
    distance = row.locator("td").nth(headings(page).index("distance from camera m")).inner_text()
    row.locator("td .class-name").click()
    expect(page.locator(".scene-cameras .camera")).to_have_attribute("data-k", "1")
    chosen = page.locator(f'tr[data-track="{track}"][aria-selected=true]')
    expect(chosen).to_be_visible()
    # Picture, card and table give one distance where they speak of the same one.
    expect(page.get_by_role("columnheader", name=re.compile("From the ego"))).to_be_visible()
    assert distance in chosen.locator("td").all_inner_texts()
    title = page.locator(".camera .object-chosen title")
    expect(title).to_have_text(re.compile(f"{distance} m from"))


def test_long_track_ids_are_short_and_whole_when_pointed_at(open_page: OpenPage) -> None:
    page = open_labels(open_page, "?tab=labels&table=objects&filter=class~eq~%22traffic_light%22")
    cell = page.locator(".label-table td[title^='track ']").first
    whole = int((cell.get_attribute("title") or "").split()[-1])
    assert whole >= 2**52
    expect(cell).to_have_text(f"L{whole - 2**52}")


def test_at_390_px_the_tab_is_no_wider_than_the_screen(open_page: OpenPage) -> None:
    page = open_page("#/datasets/scene?tab=labels", width=390, height=844)
    page.locator(".label-table tbody tr").first.wait_for()
    over = "document.querySelector('.content').scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(over) <= 0


def test_what_is_typed_into_a_filter_stays_as_it_is_typed(open_page: OpenPage) -> None:
    page = open_labels(open_page)
    page.get_by_role("button", name="Filter").click()
    value = page.get_by_label("Value of filter 1")
    for column, text in (("class", "none"), ("class", "truck"), ("distance", "10.50")):
        page.get_by_label("Column of filter 1").select_option(column)
        value.fill("")
        value.press_sequentially(text)
        expect(value).to_have_value(text)
    expect(page.locator(".label-table tbody tr").first).to_be_visible()
