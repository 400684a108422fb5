"""What many workers and millions of frames cost, computed from the figures that were measured.

Nothing is run: a thousand machines are not to be had for a test. Each row says which result files
it follows from. What the provider allows is taken from its documentation, not measured.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parents[1] / "results"
_FPS = 10
_CAMERAS = 3
"""Of the rig that ``object-store`` records; each frame of each is an object."""
_LISTED_AT_ONCE = 1000
_READ_PER_S, _WRITTEN_PER_S = 5500, 3500
"""Requests that Amazon promises for one prefix, before it splits it by load."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    Attributes:
        what: what it counts.
        value: as it is shown, with its unit.
        source: result files that it follows from, and what it assumes.
    """

    what: str
    value: str
    source: str


@dataclass(frozen=True, slots=True)
class Measured:
    """The figures that all follows from.

    Attributes:
        frames_per_s: of one worker with one thread, beside seven others.
        cpu_s_per_frame: of all its processes.
        fixed_objects: of an episode, beside one for each frame of each camera.
        object_bytes: of the median one.
        write_requests: for an episode beside those for its objects.
        other_requests: to ask, list and remove, for an episode.
        read_ms: of one object, sixteen at a time.
        plan_s_per_episode: CPU.
        catalog_per_s: episodes that PostgreSQL takes.
    """

    frames_per_s: float
    cpu_s_per_frame: float
    fixed_objects: int
    object_bytes: float
    write_requests: int
    other_requests: int
    read_ms: float
    plan_s_per_episode: float
    catalog_per_s: float


def load_measured(folder: Path = RESULTS) -> Measured:
    """Read the result files."""
    scale, store, planning, catalog = (
        _figures(folder / f"{name}.json")
        for name in ("scale-16-cores", "objects", "planning", "catalog")
    )
    objects = int(store["objects_of_an_episode"])
    others = ("GET", "HEAD", "LIST", "DELETE", "POST")
    return Measured(
        frames_per_s=scale["frames_per_s_with_8"] / 8,
        cpu_s_per_frame=scale["cpu_s_per_frame_with_8"],
        fixed_objects=objects - _CAMERAS * int(store["frames_of_an_episode"]),
        object_bytes=store["bytes_of_the_median_object"],
        write_requests=int(store["PUT_requests_to_record"]) - objects,
        other_requests=sum(int(store[f"{kind}_requests_to_record"]) for kind in others),
        read_ms=store["ms_to_read_an_object_16_at_a_time"],
        plan_s_per_episode=planning["plain_cpu_s"] / planning["episodes"],
        catalog_per_s=catalog["episodes"] / catalog["postgresql_fill_s"],
    )


def on_paper(measured: Measured, *, workers: int, frames: int, episode_s: float) -> list[Row]:
    """The table.

    Args:
        measured: what it follows from.
        workers: each with one core.
        frames: all together, of the rig with three cameras.
        episode_s: simulated seconds of an episode.
    """
    per_episode = round(episode_s * _FPS)
    episodes = math.ceil(frames / per_episode)
    pictures = per_episode * _CAMERAS
    objects = episodes * (pictures + measured.fixed_objects)
    hours = frames / (workers * measured.frames_per_s) / 3600
    written = objects + episodes * measured.write_requests
    written_per_s = written / hours / 3600
    pages = math.ceil(episodes / _LISTED_AT_ONCE)
    starts = workers * episodes
    per_s, packed = episodes / hours / 3600, episodes * (_CAMERAS + measured.fixed_objects)
    size_tb = objects * measured.object_bytes / 1e12
    plan = _duration(episodes * measured.plan_s_per_episode)
    reading = _duration(episodes * measured.read_ms / 1e3)
    scale, store = "`scale-16-cores.json`", "`objects.json`"
    rows = (
        ("episodes", f"{episodes:,}", f"of {per_episode} frames"),
        ("hours", f"{hours:.1f}", scale),
        ("core-hours", f"{frames * measured.cpu_s_per_frame / 3600:,.0f}", scale),
        ("planning: CPU time of each command", plan, "`planning.json`"),
        ("objects", f"{objects:,}", store),
        ("objects if each sensor's pictures were one", f"{packed:,}", store),
        ("terabytes", f"{size_tb:.1f}", f"{store}, median object"),
        ("requests that write", f"{written:,}", store),
        ("the same in a second", f"{written_per_s:,.0f}", "of all workers"),
        ("times what Amazon promises a prefix", f"{written_per_s / _WRITTEN_PER_S:.1f}", "3,500/s"),
        ("other requests while recording", f"{episodes * measured.other_requests:,}", store),
        ("episodes a second for the catalog", f"{per_s:.1f}", scale),
        ("episodes a second that it takes", f"{measured.catalog_per_s:,.0f}", "`catalog.json`"),
        ("requests to list all markers", f"{pages}", "1,000 in each"),
        ("one command begins anew at the end: reading the markers", reading, store),
        ("all begin anew at the end: markers to read", f"{starts:,}", "each reads all"),
        ("the same from one prefix", _duration(starts / _READ_PER_S), "5,500/s"),
    )
    return [Row(*one) for one in rows]


def table(rows: list[Row]) -> str:
    """The rows as a table of Markdown."""
    lines = ["| what | figure | from |", "|---|---|---|"]
    lines += [f"| {row.what} | {row.value} | {row.source} |" for row in rows]
    return "\n".join(lines)


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.0f} minutes" if seconds < 7200 else f"{seconds / 3600:.1f} hours"


def _figures(path: Path) -> Mapping[str, Any]:
    figures = json.loads(path.read_text())["result"]["figures"]
    return {name: figure["value"] for name, figure in figures.items()}
