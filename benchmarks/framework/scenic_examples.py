"""Do Scenic's own examples for CARLA run as scenarios? The user gives Scenic's folder.

Each program is recorded for some seconds on the embedded simulator, in the town that it names. The
towns' OpenDRIVE files lie in Scenic's folder. Nothing is fetched. What was recorded can be kept in
a file of JSON lines, so that an interrupted run goes on, and several commands share the programs.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

import carstage
from benchmarks.framework.recorded import run_carstage
from carstage.bench.verdict import Figure, Verdict

LEAST_RECORDED = 10
PROGRAMS = Path("examples") / "carla"
TOWNS = Path("assets") / "maps" / "CARLA"
TRIES = 3
"""Seeds: a program may refuse a scene of its own, as ``require always`` does."""
FPS = 10
_MODEL = re.compile(r"^model\s+scenic\.simulators\.carla\.model", re.MULTILINE)
_REPORTED = re.compile(r"the program failed: (.*)")
_CONFIG: dict[str, Any] = {
    "fps": FPS,
    "image_size": [64, 36],
    "timing": {"warmup_ticks": 2},
    "conversion": {"workers": 1},
    "rig": {"sensors": [{"id": "INSTANCE", "kind": "instance", "pose": {"x": 1.5, "z": 1.6}}]},
}


@dataclass(frozen=True, slots=True)
class Tried:
    """One program.

    Attributes:
        program: its path below the examples.
        town: where it was recorded.
        result: ``recorded``, or why not.
        seed: of the last try.
        road_users: vehicles and pedestrians in the labels, the ego among them.
        moved_m: how far the ego came.
    """

    program: str
    town: str
    result: str
    seed: int
    road_users: int = 0
    moved_m: float = 0.0

    @property
    def recorded(self) -> bool:
        """Whether its episode is whole."""
        return self.result == "recorded"


def programs(folder: Path) -> list[Path]:
    """The programs below Scenic's examples that name CARLA's model, in order."""
    found = sorted((folder / PROGRAMS).rglob("*.scenic"))
    return [path for path in found if _MODEL.search(path.read_text("utf-8"))]


def measure_scenic_examples(
    folder: Path,
    python: Path,
    *,
    chosen: Sequence[Path],
    seconds: float = 3.0,
    done: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Verdict, list[Tried]]:
    """Record each program.

    Args:
        folder: Scenic's.
        python: the interpreter that has Scenic.
        chosen: programs.
        seconds: simulated ones of each.
        done: keeps what was recorded, one JSON object per line; those programs are not run again.
        progress: called with how many are done, of how many.
    """
    tried: list[Tried] = []
    kept = _read(done, seconds)
    with tempfile.TemporaryDirectory(prefix="carstage-scenic-") as scratch:
        for number, path in enumerate(chosen):
            seeds = range(TRIES)
            if (before := kept.get(_name(folder, path))) is not None:
                one, seeds = before, range(0)
            for seed in seeds:
                work = Path(scratch) / f"{number}-{seed}"
                work.mkdir()
                one = _record(folder, path, python, seconds, seed, work)
                if one.recorded:
                    _keep(one, seconds, done)
                    break
            tried.append(one)
            progress(number + 1, len(chosen))
    recorded = sum(one.recorded for one in tried)
    return (
        Verdict(
            "scenic-examples",
            (
                Figure("programs", len(tried)),
                Figure("recorded", recorded, ">=", min(LEAST_RECORDED, len(tried))),
            ),
            [f"{seconds:g} s at {FPS} Hz on the embedded simulator; up to {TRIES} seeds each."],
        ),
        tried,
    )


def text(tried: Sequence[Tried]) -> str:
    """A table of all programs."""
    lines = ["| program | town | result | road users | ego moved (m) |", "|---|---|---|---|---|"]
    lines += [
        f"| `{one.program}` | {one.town} | {one.result} | {one.road_users or ''} | "
        f"{one.moved_m if one.recorded else ''} |"
        for one in tried
    ]
    return "\n".join(lines)


def rows(tried: Sequence[Tried]) -> list[dict[str, Any]]:
    """For the JSON object."""
    return [asdict(one) for one in tried]


def _reason(said: str) -> str:
    """What Scenic says it failed for, else the first error, else the last line."""
    if reported := _REPORTED.search(said):
        return reported[1]
    lines = said.strip().splitlines() or [""]
    return next((line for line in lines if line.startswith("error:")), lines[-1])


def _name(folder: Path, path: Path) -> str:
    return path.relative_to(folder / PROGRAMS).as_posix()


def _read(done: Path | None, seconds: float) -> dict[str, Tried]:
    """What another run of as many seconds has recorded, by program."""
    if done is None or not done.exists():
        return {}
    kept = [json.loads(line) for line in done.read_text("utf-8").splitlines()]
    return {row["program"]: Tried(**row) for row in kept if row.pop("seconds") == seconds}


def _keep(one: Tried, seconds: float, done: Path | None) -> None:
    if done is not None:
        with done.open("a", encoding="utf-8") as file:
            file.write(json.dumps({**asdict(one), "seconds": seconds}) + "\n")


def _record(folder: Path, path: Path, python: Path, seconds: float, seed: int, work: Path) -> Tried:
    name = _name(folder, path)
    config = {
        **_CONFIG,
        "seed": seed,
        "duration_s": seconds,
        "server": {"kind": "embedded", "self_test": "off", "maps": [str(folder / TOWNS)]},
        "scenario": {"kind": "scenic", "file": str(path), "python": str(python)},
    }
    (work / "config.yaml").write_text(yaml.safe_dump(config))
    out = work / "dataset"
    try:
        run_carstage("run", str(work / "config.yaml"), "--out", str(out), "--retries", "0")
        run_carstage("validate", str(out))
    except RuntimeError as error:
        return Tried(name, "", _reason(str(error)).replace("|", "/")[:200], seed)
    (episode,) = carstage.Dataset(out).episodes
    places = [row["location"] for row in episode.ego().to_pylist()]
    moved_m = sum((a - b) ** 2 for a, b in zip(places[0], places[-1], strict=True)) ** 0.5
    return Tried(
        name,
        episode.spec.map,
        "recorded",
        seed,
        road_users=len(episode.document["actors"]),
        moved_m=round(moved_m, 1),
    )
