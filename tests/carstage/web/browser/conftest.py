"""A real browser before a real server; tests fail on errors of the page and foreign requests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

import analytic_dataset
from browser_pages import CHROMIUM, FLAGS, PATIENCE_MS, Gui, OpenPage, Watch, load_demo

expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium, for one module: while Playwright runs, this thread can run no other event loop."""
    if not Path(CHROMIUM).exists():
        pytest.skip("no Chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield made
        made.close()


@pytest.fixture(scope="session")
def gui(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gui]:
    """A server over a folder with one dataset, ``scene``."""
    folder = tmp_path_factory.mktemp("gui") / "datasets"
    folder.mkdir()
    analytic_dataset.make_dataset(folder / "scene", tmp_path_factory.mktemp("scene"))
    made = Gui(folder)
    made.start()
    try:
        yield made
    finally:
        made.stop()


@pytest.fixture(scope="session")
def all_pages() -> Watch:
    return Watch()


@pytest.fixture
def watch(all_pages: Watch) -> Iterator[Watch]:
    all_pages.faults.clear()
    all_pages.server_may_be_gone = all_pages.may_ask_in_vain = False
    yield all_pages
    assert all_pages.faults == []


@pytest.fixture
def open_page(browser: Browser, gui: Gui, watch: Watch) -> Iterator[OpenPage]:
    """Open a page of the interface in a browser of its own: ``open_page("#/run", width=…)``."""
    contexts: list[BrowserContext] = []

    def make(
        address: str = "",
        *,
        width: int = 1440,
        height: int = 900,
        theme: str = "dark",
        script: str = "",
    ) -> Page:
        page = new_page(browser, watch, width, height, theme)
        contexts.append(page.context)
        if script:
            page.add_init_script(script)
        page.goto(gui.url + address)
        return page

    yield make
    for context in contexts:
        context.close()


def new_page(browser: Browser, watch: Watch, width: int, height: int, theme: str) -> Page:
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme="light" if theme == "light" else "dark",
    )
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    watch.follow(page)
    return page


@pytest.fixture(scope="module")
def shared_page(browser: Browser, gui: Gui, all_pages: Watch) -> Iterator[Page]:
    """One page for all tests that only change the configuration: loading it is the dear part."""
    page = new_page(browser, all_pages, 1440, 900, "dark")
    page.goto(gui.url)
    yield page
    page.context.close()


@pytest.fixture
def configure(shared_page: Page, watch: Watch) -> Page:
    """The first page with the demonstration's configuration, saved; nothing chosen."""
    load_demo(shared_page)
    return shared_page
