"""How soon the form is usable, how closely a drag is followed, how soon a sensor shows its view."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from benchmarks.framework.gui.chromium import fresh_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_SENSOR = "CAM_LEFT"
_SCENE = ".scene-host[data-ready=true] canvas"

_WHEN_USABLE = """
const look = () => {
  const field = document.querySelector('.config-form input:enabled:not([readonly])');
  if (field) window.usableMs = performance.now();
  else requestAnimationFrame(look);
};
requestAnimationFrame(look);
"""

_COUNT_FRAMES = """() => {
  const mark = document.querySelector('.view-top [data-sensor="SENSOR"] .mark-dot').ownerSVGElement;
  const moves = [];
  let frame = 0;
  new MutationObserver(() => moves.forEach((move) => (move.marked = true)))
    .observe(mark, {subtree: true, attributes: true, attributeFilter: ['cx', 'cy']});
  addEventListener('pointermove', () =>
    moves.push({frame, at: performance.now(), drawn: carstage3d.drawn()}), true);
  const after = new MessageChannel();
  // The message of a frame's callback comes after that frame was painted.
  after.port1.onmessage = () => {
    for (const move of moves) {
      if (move.behind !== undefined || !move.marked) continue;
      if (carstage3d.drawn() === move.drawn) continue;
      move.behind = frame - move.frame;
      move.ms = performance.now() - move.at;
    }
  };
  const next = () => {
    frame += 1;
    after.port2.postMessage(0);
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
  window.dragMoves = moves;
}""".replace("SENSOR", _SENSOR)

_WATCH_PREVIEW = """() => {
  window.letGo = [];
  let from = null;
  addEventListener('pointerup', () => (from = performance.now()), true);
  const preview = document.querySelector('.sensor-preview');
  new MutationObserver(() => {
    if (from !== null) window.letGo.push(performance.now() - from);
    from = null;
  }).observe(preview, {subtree: true, attributes: true, attributeFilter: ['src']});
}"""


def usable_s(browser: Browser, url: str, loads: int) -> list[float]:
    """Seconds from the start of the navigation until a field can be typed in; empty caches."""
    found = []
    for _ in range(loads):
        with fresh_page(browser, _WHEN_USABLE) as page:
            page.goto(url)
            wait_for(page, "window.usableMs > 0")
            field = page.locator(".config-form input:enabled:not([readonly])").first
            before = field.input_value()
            field.press_sequentially("x")
            if field.input_value() == before:
                continue  # it looked usable, and was not
            field.fill(before)
            page.locator("[data-saved=saved]").wait_for()
            found.append(page.evaluate("window.usableMs") / 1000)
    return found


@dataclass(frozen=True, slots=True)
class Followed:
    """A drag: per move, frames and milliseconds until mark and 3D model were painted there."""

    frames: list[int]
    milliseconds: list[float]


def drag(browser: Browser, url: str, moves: int) -> Followed:
    """Drag a sensor in the top view and count frames until the mark and the mesh have followed."""
    with fresh_page(browser) as page:
        page.goto(url)
        _choose(page)
        page.evaluate(_COUNT_FRAMES)
        at = _grasp(page)
        for step in range(moves):
            page.mouse.move(at[0] + 12 + 3 * (step % 20), at[1] - 12 - 2 * (step % 30))
        wait_for(page, "window.dragMoves.slice(-1)[0].behind !== undefined")
        page.mouse.up()
        seen = page.evaluate("window.dragMoves.filter((move) => move.behind !== undefined)")
        _undo(page)
    seen = seen[-moves:]
    return Followed([move["behind"] for move in seen], [move["ms"] for move in seen])


@dataclass(frozen=True, slots=True)
class Looked:
    """Through a sensor: seconds from the press to the first picture, the simulator started or not,
    and after each letting go.
    """

    first_s: float
    warm_s: float
    after_s: list[float]


def look(browser: Browser, url: str, drags: int) -> Looked:
    """Preview through a sensor, and drag it a few times."""
    with fresh_page(browser) as page:
        page.goto(url)
        _choose(page)
        begun = page.evaluate("performance.now()")
        page.get_by_role("button", name="Preview through this sensor").click()
        page.locator(".sensor-preview img").wait_for()
        first_s = (page.evaluate("performance.now()") - begun) / 1000
        page.locator(".sensor-preview[aria-busy=false]").wait_for()
        page.evaluate(_WATCH_PREVIEW)
        for number in range(drags):
            at = _grasp(page)
            for step in range(1, 6):
                page.mouse.move(at[0] + 6 * step, at[1] + 6 * step * (-1) ** number)
            page.mouse.up()
            wait_for(page, f"window.letGo.length > {number}")
            page.locator(".sensor-preview[aria-busy=false]").wait_for()
        after_s = [milliseconds / 1000 for milliseconds in page.evaluate("window.letGo")]
        for _ in range(drags):
            _undo(page)
    with fresh_page(browser) as page:
        page.goto(url)
        _choose(page)
        begun = page.evaluate("performance.now()")
        page.get_by_role("button", name="Preview through this sensor").click()
        page.locator(".sensor-preview img").wait_for()
        warm_s = (page.evaluate("performance.now()") - begun) / 1000
    return Looked(first_s, warm_s, after_s)


def wait_for(page: Page, condition: str) -> None:
    """Until an expression of JavaScript is true; the page's policy forbids to wait inside it."""
    while not page.evaluate(f"Boolean({condition})"):
        page.wait_for_timeout(20)


def median(values: list[Any]) -> float:
    """The median; NaN of nothing, which meets no target."""
    return float(statistics.median(values)) if values else float("nan")


def _choose(page: Page) -> None:
    sensors = page.get_by_role("list", name="Sensors")
    sensors.get_by_role("button", name=_SENSOR).click()
    page.locator(_SCENE).wait_for()
    page.locator(".view-top .car-body").first.wait_for()
    wait_for(page, "window.carstage3d && carstage3d.drawn() > 0")


def _grasp(page: Page) -> tuple[float, float]:
    """Press on the sensor's mark, with Shift: no steps, so every move is a change."""
    box = page.locator(f'.view-top [data-sensor="{_SENSOR}"]').bounding_box()
    assert box is not None
    at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*at)
    page.mouse.down()
    page.keyboard.down("Shift")
    return at


def _undo(page: Page) -> None:
    page.keyboard.up("Shift")
    page.keyboard.press("Control+z")
    page.locator("[data-saved=saved]").wait_for()
