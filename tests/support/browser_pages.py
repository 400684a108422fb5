"""A ``carstage gui`` process that tests start, kill and watch, and steps that many of them take."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import ConsoleMessage, Locator, Page

CHROMIUM = "/usr/bin/chromium"
#: WebGL in software, as on a machine without a graphics card. The rest of the page must not go
#: through it, too: that takes sixteen times as long.
FLAGS = ["--enable-unsafe-swiftshader", "--disable-gpu-compositing", "--no-sandbox"]
#: Folder for the documentation's pictures; empty: none are made.
PICTURES = os.environ.get("CARSTAGE_PICTURES", "")
_QUALITY_OF_JPEG = 85
START_S = 60.0
PATIENCE_MS = 25_000
#: Refusals that a page provokes on purpose and shows at the field; browsers log them as errors.
REFUSALS = re.compile(r"status of (409|422) ")
#: What a page asks for by an address that names what is not there.
MISSING = re.compile(r"status of 404 ")
#: While the server is gone, requests of the page fail.
GONE = re.compile(r"ERR_CONNECTION|ERR_EMPTY_RESPONSE|WebSocket connection to")


class Gui:
    """A ``carstage gui`` process on one port, which can be killed and started again."""

    def __init__(self, datasets: Path) -> None:
        self.datasets = datasets
        self.port = 0
        self._process: subprocess.Popen[str] | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def start(self) -> None:
        command = [sys.executable, "-m", "carstage.cli", "gui", "--no-browser", "--no-token"]
        command += ["--datasets", str(self.datasets), "--port", str(self.port)]
        log = self.datasets.with_suffix(".log").open("a")
        with log:
            self._process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, stdin=subprocess.DEVNULL, text=True
            )
        self.port = self._announced_port()

    def _announced_port(self) -> int:
        assert self._process is not None
        assert self._process.stdout is not None
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            ready, _, _ = select.select([self._process.stdout], [], [], 1.0)
            line = self._process.stdout.readline() if ready else ""
            if found := re.search(r"http://127\.0\.0\.1:(\d+)", line):
                return int(found.group(1))
            assert self._process.poll() is None, self.datasets.with_suffix(".log").read_text()
        raise AssertionError(f"no address within {START_S} s")

    def kill(self) -> None:
        """As a crash would: SIGKILL, nothing tidied up."""
        assert self._process is not None
        self._process.send_signal(signal.SIGKILL)
        self._end()

    def stop(self) -> None:
        if self._process is not None:
            self._process.send_signal(signal.SIGTERM)
            self._end()

    def _end(self) -> None:
        assert self._process is not None
        try:
            self._process.wait(20)
        finally:
            if self._process.poll() is None:
                self._process.kill()
                self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()
            self._process = None


class Watch:
    """What the pages of one test do that they must not."""

    def __init__(self) -> None:
        self.faults: list[str] = []
        self.server_may_be_gone = False
        self.may_ask_in_vain = False

    def follow(self, page: Page) -> None:
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.faults.append(f"uncaught: {error}"))
        page.on("request", lambda request: self._request(request.url))

    def _console(self, message: ConsoleMessage) -> None:
        if message.type != "error" or REFUSALS.search(message.text):
            return
        if self.server_may_be_gone and GONE.search(message.text):
            return
        if self.may_ask_in_vain and MISSING.search(message.text):
            return
        self.faults.append(f"console: {message.text}")

    def _request(self, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme in ("http", "https", "ws", "wss") and parts.hostname != "127.0.0.1":
            self.faults.append(f"request to {url}")


OpenPage = Callable[..., Page]


def load_demo(page: Page) -> None:
    """The demonstration's configuration, as it is at first, and nothing chosen."""
    text_view = page.get_by_role("button", name="YAML", exact=True)
    if text_view.get_attribute("aria-pressed") == "true":  # a test before this one has failed
        text_view.click()
    page.get_by_role("button", name="File: configuration").click()
    page.get_by_role("menuitem", name="Load the demonstration").click()
    wait_until_saved(page)
    page.get_by_role("heading", name="Sensor rig").click()
    page.locator(".view-top .ground").click(position={"x": 5, "y": 60})
    for name in ("Fit, Top", "Fit, Side"):
        page.get_by_role("button", name=name).click()
    page.get_by_label("Coverage of the ground").select_option("off")


def picture(page: Page, name: str, gui: Gui, part: Locator | None = None) -> None:
    """A picture for the documentation, where one was asked for; its datasets lie in ``/data``.

    Args:
        page: what is shown.
        name: of the file; ``.jpg`` where most of it is what a camera saw.
        gui: whose datasets they are.
        part: what alone is shown; None: the whole page.
    """
    if not PICTURES:
        return
    page.evaluate(
        """(folder) => {
          const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
          while (texts.nextNode())
            if (texts.currentNode.data.includes(folder))
              texts.currentNode.data = texts.currentNode.data.replaceAll(folder, '/data');
        }""",
        str(gui.datasets),
    )
    quality = _QUALITY_OF_JPEG if name.endswith(".jpg") else None
    (part or page).screenshot(path=Path(PICTURES) / name, quality=quality)


def wait_until(page: Page, condition: str, where: object = "") -> None:
    """Until an expression of JavaScript is true; ``where`` is said if it never is.

    ``Page.wait_for_function`` would evaluate it inside the page, whose policy forbids that.
    """
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while not page.evaluate(condition):
        assert time.monotonic() < deadline, f"not within {PATIENCE_MS} ms: {condition} {where}"
        page.wait_for_timeout(50)


def wait_until_saved(page: Page) -> None:
    """Until nothing is on its way to the server any more."""
    page.locator("[data-saved=saved]").wait_for()


def saved_config(page: Page) -> dict[str, Any]:
    """The configuration as the server has it when nothing is on its way any more."""
    wait_until_saved(page)
    return server_config(page)


def server_config(page: Page) -> dict[str, Any]:
    """The configuration as the server has it now."""
    answer: dict[str, dict[str, Any]] = page.evaluate("fetch('api/config').then((a) => a.json())")
    return answer["config"]


def wait_until_saved_as(page: Page, key: str, value: object) -> None:
    """Until the server's configuration has a value; text is read a while after it was typed."""
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while saved_config(page)[key] != value:
        assert time.monotonic() < deadline, f"{key} is {saved_config(page)[key]}, not {value}"
        page.wait_for_timeout(50)


def field(page: Page, name: str) -> Locator:
    """The input or menu of a setting, by its title; the unit may follow it."""
    return page.get_by_label(re.compile(rf"^{re.escape(name)}( [\w°/]+)?$")).and_(
        page.locator("input, select")
    )
