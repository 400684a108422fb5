"""Live pictures of a run: how many arrive, how old they are, and that nobody pays for none."""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.framework.gui.chromium import fresh_page
from benchmarks.framework.gui.interface import Interface
from carstage.rawlog.tail import NewestRecords
from carstage.server import EmbeddedServer, Endpoint

if TYPE_CHECKING:
    from playwright.sync_api import Browser

RATE_HZ = 10.0
CAMERAS = 5
_SIZE = (320, 180)
"""Of a camera: as many pixels as a thumbnail has, and raw data that any disk takes."""
PACE_HZ = 12.0
"""Faster than is shown, as most runs are."""
_LOOP = 20
_LOOK_S = 0.02
_UNWATCHED_TICKS = 60
_REPORT_S = 1.0
_SPARE_S = 120.0
"""Recorded longer than watched: to start a browser takes a while."""

_DRAWN = """() => {
  window.drawnPictures = [];
  const observe = (records) => {
    const at = performance.timeOrigin + performance.now();
    for (const {target} of records)
      if (target.dataset.tick)
        window.drawnPictures.push(
          [target.closest('[data-sensor]').dataset.sensor, Number(target.dataset.tick), at / 1000]);
  };
  new MutationObserver(observe).observe(document.querySelector('.thumbs'),
    {subtree: true, attributes: true, attributeFilter: ['data-tick']});
}"""


@dataclass(frozen=True, slots=True)
class Drawn:
    """A picture that a page has shown: Unix time, and seconds since its tick was in the log."""

    sensor: str
    tick: int
    time_s: float
    age_s: float


@dataclass(frozen=True, slots=True)
class Watched:
    """What a page saw of a run.

    Attributes:
        unwatched_previews: files that were made before anybody looked.
        unwatched_ticks: how long nobody did.
        pictures: in the order in which they were shown.
        seconds: how long it was watched.
        source_hz: ticks per second meanwhile.
    """

    unwatched_previews: int
    unwatched_ticks: int
    pictures: list[Drawn]
    seconds: float
    source_hz: float

    def rate_hz(self) -> float:
        """Pictures per second of the camera that gave fewest."""
        counts = dict.fromkeys(_names(), 0)
        for picture in self.pictures:
            counts[picture.sensor] += 1
        return min(counts.values()) / self.seconds

    def age_s(self, begin_s: float, end_s: float) -> float:
        """Median age of the pictures of a time, in seconds since the first; NaN of none."""
        first_s = self.pictures[0].time_s if self.pictures else 0.0
        ages = [p.age_s for p in self.pictures if begin_s <= p.time_s - first_s <= end_s]
        return statistics.median(ages) if ages else float("nan")


def watch_run(
    browser: Browser, served: Interface, seconds: float, progress: Callable[[int, int], None]
) -> Watched:
    """Record with nobody watching, then watch the same run.

    Args:
        browser: to watch with.
        served: the interface.
        seconds: how long to watch.
        progress: called with the seconds watched and their total number.

    Raises:
        ServerError: the run does not get under way.
    """
    arguments = ("--loop", str(_LOOP), "--pace", str(PACE_HZ))
    with (
        EmbeddedServer(arguments=arguments) as simulator,
        _run(served, simulator.endpoint, seconds) as run,
    ):
        served.await_tick(run, _UNWATCHED_TICKS)
        folder = next(served.datasets.glob(f"*/runs/{run}"))
        unwatched = len(list((folder / "preview").glob("*")))
        ticks = (served.run(run)["current"] or {}).get("ticks_done", 0)
        attempt = next(path.parent for path in folder.glob("raw/*/*/episode.json"))
        with fresh_page(browser) as page, _log_times(attempt, _names()[0]) as written:
            page.goto(f"{served.url}#/run/{run}")
            page.locator(".thumb canvas[data-tick]:not([data-tick=''])").nth(CAMERAS - 1).wait_for()
            page.evaluate(_DRAWN)
            begin_s = time.time()
            while (passed_s := time.time() - begin_s) < seconds:
                page.wait_for_timeout(_REPORT_S * 1000)
                progress(round(min(passed_s, seconds)), round(seconds))
            rows = page.evaluate("window.drawnPictures")
            passed_s = time.time() - begin_s
    pictures = [
        Drawn(sensor, tick, at_s, at_s - written[tick])
        for sensor, tick, at_s in rows
        if tick in written and sensor in _names()
    ]
    source = [tick for tick, at_s in written.items() if begin_s <= at_s <= begin_s + passed_s]
    source_hz = (max(source) - min(source)) / passed_s if source else 0.0
    return Watched(unwatched, ticks, pictures, passed_s, source_hz)


def _names() -> list[str]:
    return [f"CAM_{number}" for number in range(CAMERAS)]


@contextmanager
def _run(served: Interface, endpoint: Endpoint, seconds: float) -> Iterator[str]:
    """A run of five cameras that goes on longer than anybody looks; its id. Ended at the end."""
    served.put_config(_config(endpoint, seconds + _SPARE_S))
    run: str = served.post("/runs", {"dataset": "thumbnails"})["run_id"]
    try:
        yield run
    finally:
        served.stop(run)


def _config(endpoint: Endpoint, duration_s: float) -> dict[str, Any]:
    pose = {"x": 1.5, "z": 1.6}
    return {
        "name": "thumbnails",
        "duration_s": duration_s,
        "fps": RATE_HZ,
        "image_size": list(_SIZE),
        "vehicles": {"count": 5},
        "pedestrians": {"count": 0},
        "labels": {"cameras": []},
        "rig": {
            "sensors": [
                {"id": name, "kind": "rgb", "pose": {**pose, "yaw_deg": 72 * number}}
                for number, name in enumerate(_names())
            ]
        },
        "server": {
            "kind": "remote",
            "host": endpoint.host,
            "port": endpoint.port,
            "self_test": "off",
        },
    }


@contextmanager
def _log_times(attempt: Path, stream: str) -> Iterator[dict[int, float]]:
    """When each tick of a stream was in the log, Unix time; grows while it is open."""
    times: dict[int, float] = {}
    ended = threading.Event()

    def follow() -> None:
        records = NewestRecords(attempt, stream)
        while not ended.wait(_LOOK_S):
            record = records.look()
            if record is not None:
                times[record.tick] = time.time()

    follower = threading.Thread(target=follow, name="log times")
    follower.start()
    try:
        yield times
    finally:
        ended.set()
        follower.join()
