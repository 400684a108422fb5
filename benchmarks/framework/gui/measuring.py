"""All figures of the interface beside their targets."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.framework.gui.bundle import (
    BUNDLE_BYTES,
    FIRST_PAGE_BYTES,
    compressed_bytes,
    first_page_bytes,
)
from benchmarks.framework.gui.chromium import chromium
from benchmarks.framework.gui.editing import Followed, Looked, drag, look, median, usable_s
from benchmarks.framework.gui.interface import interface
from benchmarks.framework.gui.looking import (
    CAMERAS as LOOKED_THROUGH,
)
from benchmarks.framework.gui.looking import (
    EPISODES,
    FRAMES,
    POINTS,
    RUNS,
    OpenTimes,
    Scrubbed,
    open_large,
    scrub,
    slowest,
)
from benchmarks.framework.gui.thumbnails import CAMERAS, PACE_HZ, RATE_HZ, Watched, watch_run
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict

MINUTES = 5.0
USABLE_S = 1.0
FIRST_PREVIEW_S = 5.0
FRAMES_PER_S = 15.0
OPEN_S = 2.0
RUNS_S = 0.3
FRAMES_BEHIND = 3
LOOK_S = 1.0
AGE_S = 0.5
AGE_GROWTH = 1.2
_RATE_SHARE = 0.95
"""Of the 10 Hz: the simulator's own pace is as even as its machine is."""
_LOADS = 5
_MOVES = 100
_DRAGS = 5
_SCRUB_S = 20.0


def measure_gui(
    *,
    minutes: float = MINUTES,
    scratch: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Load, drag, look through a sensor, watch a run.

    Args:
        minutes: how long the run is watched.
        scratch: where datasets go.
        progress: called with the seconds watched and their total number.

    Raises:
        BadInputError: Playwright or Chromium is missing.
        ServerError: the interface or the simulator does not start.
    """
    with (
        chromium() as browser,
        tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as name,
        interface(Path(name) / "datasets") as served,
    ):
        loads_s = usable_s(browser, served.url, _LOADS)
        followed = drag(browser, served.url, _MOVES)
        looked = look(browser, served.url, _DRAGS)
        watched = watch_run(browser, served, minutes * 60, progress)
        scrubbed = scrub(browser, served, _SCRUB_S)
        opened = open_large(browser, Path(name) / "large", _LOADS)
    part_s = min(60.0, minutes * 60 / 3)
    return Verdict(
        "gui",
        (
            Figure("machine_slowness", slowness()),
            *_editing(loads_s, followed, looked),
            *_watching(watched, part_s),
            *_looking(scrubbed, opened),
            Figure("bundle_bytes_gzip", sum(compressed_bytes().values()), "<=", BUNDLE_BYTES),
            Figure("first_page_bytes_gzip", first_page_bytes(), "<=", FIRST_PAGE_BYTES),
            Figure("load_1_min", os.getloadavg()[0]),
        ),
        (
            "Chromium with WebGL in software, 1440x900, on the machine of server and simulator.",
            "A picture's age: from its record in the raw log to its drawing in the page.",
            f"Scrubbing: a hand drags to and fro; a frame counts when all {LOOKED_THROUGH} cameras "
            f"and the points show it. The large dataset has {EPISODES} episodes of {FRAMES} "
            f"frames, among {RUNS} runs.",
            f"The simulator repeats {CAMERAS} cameras of 320x180 at {PACE_HZ:g} Hz, of which "
            f"{RATE_HZ:g} are shown; first and last are the first and last {part_s:g} s.",
        ),
    )


def _editing(loads_s: list[float], followed: Followed, looked: Looked) -> tuple[Figure, ...]:
    return (
        Figure("form_usable_s_median", median(loads_s), "<=", USABLE_S),
        Figure("form_usable_s_worst", max(loads_s)),
        Figure("drag_moves", len(followed.frames), ">=", _MOVES),
        Figure("drag_frames_behind_median", median(followed.frames), "<=", FRAMES_BEHIND),
        Figure("drag_frames_behind_worst", max(followed.frames, default=0)),
        Figure("drag_ms_median", median(followed.milliseconds)),
        Figure("sensor_view_after_letting_go_s_median", median(looked.after_s), "<=", LOOK_S),
        Figure("sensor_view_after_letting_go_s_worst", max(looked.after_s)),
        Figure("sensor_view_first_s_with_start_of_simulator", looked.first_s),
        Figure("sensor_view_first_s_warm", looked.warm_s, "<=", FIRST_PREVIEW_S),
    )


def _looking(scrubbed: Scrubbed, opened: OpenTimes) -> tuple[Figure, ...]:
    return (
        Figure("scrub_points", scrubbed.points, ">=", POINTS),
        Figure("scrub_frames_per_s", scrubbed.per_s, ">=", FRAMES_PER_S),
        Figure("large_dataset_opens_s_first_ever", opened.first_s),
        Figure("large_dataset_opens_s_worst", slowest(opened.again_s), "<=", OPEN_S),
        Figure("large_dataset_opens_s_after_a_start", opened.restarted_s, "<=", OPEN_S),
        Figure("runs_answer_s_median", median(opened.runs_answer_s)),
        Figure("runs_listed_s_median", median(opened.runs_s), "<=", RUNS_S),
    )


def _watching(watched: Watched, part_s: float) -> tuple[Figure, ...]:
    first_s = watched.age_s(0, part_s)
    last_s = watched.age_s(watched.seconds - part_s, watched.seconds)
    return (
        Figure("unwatched_ticks", watched.unwatched_ticks),
        Figure("unwatched_previews", watched.unwatched_previews, "==", 0),
        Figure("watched_s", watched.seconds),
        Figure("simulator_ticks_per_s", watched.source_hz),
        Figure("thumbnails_per_s_slowest_camera", watched.rate_hz(), ">=", _RATE_SHARE * RATE_HZ),
        Figure("preview_age_s_first", first_s, "<=", AGE_S),
        Figure("preview_age_s_last", last_s, "<=", AGE_S),
        Figure("preview_age_growth", last_s / first_s, "<=", AGE_GROWTH),
    )
