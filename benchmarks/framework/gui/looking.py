"""Looking at data: how fast frames follow the scrubber, large datasets open, runs are listed."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from benchmarks.framework.gui.chromium import fresh_page
from benchmarks.framework.gui.editing import wait_for
from benchmarks.framework.gui.interface import Interface, interface
from carstage.storage import LocalStore
from carstage.storage.marker import CommitMarker, FileEntry

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CAMERAS = 5
POINTS = 100_000
_SIZE = (640, 360)
_FRAMES = 30
EPISODES = 1000
FRAMES = 1000
RUNS = 200
_RUNS_PER_DATASET = 100
_RECORD_S = 900.0
_SWEEP_STEPS = _FRAMES
"""A hand that asks for another frame at each move: what is shown is not bounded by it."""

_SHOWN = """() => {
  window.shownFrames = [];
  const cloud = document.querySelector('.cloud-view');
  const look = () => {
    const k = cloud.dataset.k;
    const cameras = [...document.querySelectorAll('.camera-grid .camera')];
    if (cameras.length >= CAMERAS && cameras.every((one) => one.dataset.k === k))
      window.shownFrames.push([performance.now(), Number(k), Number(cloud.dataset.points)]);
  };
  new MutationObserver(look).observe(cloud, {attributes: true, attributeFilter: ['data-k']});
}""".replace("CAMERAS", str(CAMERAS))


@dataclass(frozen=True, slots=True)
class Scrubbed:
    """Frames that were shown while a hand scrubbed, each with all cameras and all points."""

    frames: int
    seconds: float
    points: float

    @property
    def per_s(self) -> float:
        """Frames a second."""
        return self.frames / self.seconds


def record(served: Interface) -> tuple[str, str]:
    """Record an episode of five cameras and a dense LiDAR; its dataset and its id."""
    pose = {"x": 1.2, "z": 1.7}
    cameras = [
        {"id": f"CAM_{n}", "kind": "rgb", "pose": {**pose, "yaw_deg": 72 * n}}
        for n in range(CAMERAS)
    ]
    lidar = {
        "id": "LIDAR", "kind": "lidar", "pose": {"z": 1.9},
        # A few rays more than points wanted: the sky gives none.
        "attributes": {"channels": 64, "points_per_second": 1_100_000, "range_m": 120,
                       "upper_fov_deg": 2, "lower_fov_deg": -24.9, "dropoff_general_rate": 0.0},
    }  # fmt: skip
    served.put_config(
        {
            "name": "looking", "duration_s": _FRAMES / 10, "fps": 10, "image_size": list(_SIZE),
            "vehicles": {"count": 10}, "pedestrians": {"count": 5},
            "labels": {"cameras": ["CAM_0"]}, "rig": {"sensors": [*cameras, lidar]},
        }
    )  # fmt: skip
    run = served.post("/runs", {"dataset": "looking"})["run_id"]
    deadline_s = time.monotonic() + _RECORD_S
    while served.run(run)["alive"] not in ("ended", "dead"):
        if time.monotonic() > deadline_s:
            served.stop(run)
        time.sleep(0.5)
    (episode,) = served.get("/datasets/looking")["episodes"]
    return "looking", episode["episode_id"]


def scrub(browser: Browser, served: Interface, seconds: float) -> Scrubbed:
    """Drag the scrubber to and fro through an episode, all cameras and the points in view."""
    dataset, episode = record(served)
    with fresh_page(browser) as page:
        page.goto(f"{served.url}#/datasets/{dataset}/{episode}?cameras=all")
        page.locator(".cloud-view:not([data-points='0'])").wait_for()
        wait_for(page, "window.carstageCloud && carstageCloud.drawn() > 0")
        page.evaluate(_SHOWN)
        slider = page.get_by_role("slider", name="Frame")
        box = slider.bounding_box()
        assert box is not None
        y = box["y"] + box["height"] / 2
        page.mouse.move(box["x"] + 8, y)
        page.mouse.down()
        begin_s, step = time.monotonic(), 0
        while time.monotonic() - begin_s < seconds:
            share = abs((step / _SWEEP_STEPS) % 2 - 1)
            page.mouse.move(box["x"] + 8 + (box["width"] - 16) * share, y)
            page.wait_for_timeout(1000 / 60)
            step += 1
        page.mouse.up()
        shown: list[list[float]] = page.evaluate("window.shownFrames")
    if len(shown) < 2:
        return Scrubbed(len(shown), seconds, 0.0)
    lasted_s = (shown[-1][0] - shown[0][0]) / 1000
    return Scrubbed(
        len(shown) - 1, lasted_s, sorted(points for _, _, points in shown)[len(shown) // 2]
    )


def large_dataset(folder: Path, episodes: int = EPISODES, frames: int = FRAMES) -> None:
    """A dataset of committed episodes: every document of it, none of its pictures."""
    store = LocalStore(folder)
    store.initialise("large")
    sensors = [bare_sensor("CAM_FRONT", "rgb"), bare_sensor("LIDAR_TOP", "lidar")]
    folders = (("CAM_FRONT", "jpg"), ("LIDAR_TOP", "npz"))
    names = [f"sensors/{name}/{k:06d}.{end}" for name, end in folders for k in range(frames)]
    files = tuple(FileEntry(name, 100_000, f"sha256:{'0' * 64}") for name in names)
    # All markers are alike but for the id; to write each of 2,000 files anew takes minutes.
    pattern = CommitMarker("EPISODE", "a1", frames, files, {"carstage": "0"}).to_bytes()
    for index in range(episodes):
        episode_id = f"{index:016x}"
        spec = bare_spec(sensors, index=index, steps=frames)
        attempt = folder / "episodes" / episode_id / "a1"
        attempt.mkdir(parents=True)
        (attempt / "episode.json").write_text(json.dumps({"format_version": 1, "spec": spec}))
        marker = pattern.replace(b"EPISODE", episode_id.encode(), 1)
        (folder / "commits" / f"{episode_id}.json").write_bytes(marker)


def runs_of(root: Path, runs: int = RUNS) -> None:
    """Folders of runs that have ended."""
    for number in range(runs):
        dataset = root / f"runs-{number // _RUNS_PER_DATASET}"
        if not dataset.exists():
            LocalStore(dataset).initialise(dataset.name)
        run_id = f"2026{number:04d}-000000-{number:06x}"
        folder = dataset / "runs" / run_id
        folder.mkdir(parents=True)
        status = {
            "format_version": 1, "run_id": run_id, "state": "done", "pid": 1, "message": None,
            "process_started": 1.0, "host": "bench", "heartbeat": 1.7e9 + number,
            "episodes": {"total": 1, "committed": 1, "failed": 0, "skipped": 0}, "current": None,
        }  # fmt: skip
        (folder / "status.json").write_text(json.dumps(status))
        spec = bare_spec([bare_sensor("CAM", "rgb")], steps=10)
        plan = {
            "format_version": 1, "run_id": run_id, "config": {"name": f"run {number}"},
            "episodes": [{"episode_id": "e1", "spec": spec}],
        }  # fmt: skip
        (folder / "plan.json").write_text(json.dumps(plan))


@dataclass(frozen=True, slots=True)
class OpenTimes:
    """Seconds until a large dataset shows its episodes, and until all runs are listed."""

    first_s: float
    again_s: list[float]
    restarted_s: float
    runs_answer_s: list[float]
    runs_s: list[float]


def open_large(browser: Browser, root: Path, times: int) -> OpenTimes:
    """Open a dataset of a million frames: the first time ever, again, and after a new start."""
    large_dataset(root / "large")
    runs_of(root)
    with interface(root) as served:
        first_s = _open(browser, served)
        again_s = [_open(browser, served) for _ in range(times)]
        answers_s, listed_s = [], []
        for _ in range(times):
            begin_s = time.perf_counter()
            assert len(served.get("/runs")["runs"]) >= RUNS
            answers_s.append(time.perf_counter() - begin_s)
            listed_s.append(_list_runs(browser, served))
    with interface(root) as served:
        restarted_s = _open(browser, served)
    return OpenTimes(first_s, again_s, restarted_s, answers_s, listed_s)


def _open(browser: Browser, served: Interface) -> float:
    """From the click on the dataset to its episodes."""
    with _datasets_page(browser, served) as page:
        return _until(page, "location.hash = '#/datasets/large'", ".episode-card")


def _list_runs(browser: Browser, served: Interface) -> float:
    with _datasets_page(browser, served) as page:
        condition = f"document.querySelectorAll('a[href^=\"#/run/\"]').length >= {RUNS}"
        return _until(page, "location.hash = '#/run'", "", condition)


@contextmanager
def _datasets_page(browser: Browser, served: Interface) -> Iterator[Page]:
    with fresh_page(browser) as page:
        page.goto(f"{served.url}#/configure")
        page.locator("[data-saved=saved]").wait_for()
        # Scripts of the pages are there, as they are for whoever has looked at one before.
        for address in ("#/datasets/runs-0", "#/run", "#/configure"):
            page.evaluate(f"location.hash = '{address}'")
            page.get_by_role("heading", level=1).or_(
                page.get_by_role("heading", name="Sensor rig")
            ).first.wait_for(state="attached")
        yield page


def _until(page: Page, action: str, selector: str, condition: str = "") -> float:
    """Seconds from an action until what it leads to has been painted."""
    wanted = condition or f"Boolean(document.querySelector({json.dumps(selector)}))"
    milliseconds: float = page.evaluate(
        "() => new Promise((done) => { const begin = performance.now(); ACTION;"
        " const look = () => WANTED ? requestAnimationFrame(() => done(performance.now() - begin))"
        " : requestAnimationFrame(look); look(); })".replace("ACTION", action).replace(
            "WANTED", f"({wanted})"
        )
    )
    return milliseconds / 1000


def slowest(values: list[Any]) -> float:
    """The greatest; NaN of nothing, which meets no target."""
    return float(max(values)) if values else float("nan")
