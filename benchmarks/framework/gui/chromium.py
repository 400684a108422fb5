"""Chromium, driven by Playwright; neither is needed for anything but measuring and testing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from carstage.errors import BadInputError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

PATH_VARIABLE = "CARSTAGE_CHROMIUM"
FLAGS = ("--enable-unsafe-swiftshader", "--disable-gpu-compositing", "--no-sandbox")
"""WebGL in software, as on a machine without a graphics card."""
_NAMES = ("chromium", "chromium-browser", "google-chrome")
_PATIENCE_MS = 120_000


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless browser, ended at the end.

    Raises:
        BadInputError: Playwright or Chromium is missing.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise BadInputError(
            "This measurement drives a browser through Playwright, which is not installed.",
            "Run `pip install playwright`; it needs a browser, too: `apt-get install chromium`.",
        ) from error
    executable = os.environ.get(PATH_VARIABLE) or next(
        filter(None, map(shutil.which, _NAMES)), None
    )
    if executable is None:
        raise BadInputError(
            "There is no Chromium to measure with.",
            f"Run `apt-get install chromium`, or name one in {PATH_VARIABLE}.",
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def fresh_page(browser: Browser, script: str = "") -> Iterator[Page]:
    """A page with an empty cache, 1440x900.

    Args:
        browser: from :func:`chromium`.
        script: runs in it before its own.
    """
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme="dark")
    try:
        context.set_default_timeout(_PATIENCE_MS)
        page = context.new_page()
        if script:
            page.add_init_script(script)
        yield page
    finally:
        context.close()
