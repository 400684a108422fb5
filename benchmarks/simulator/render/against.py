"""Do pictures look as they did at an earlier commit, and do they flicker no more?"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render import pictures_process
from benchmarks.simulator.render.looks import lab
from carstage.bench.verdict import Figure, Verdict

_ROOT = Path(__file__).parents[3]
_MOST_APART = 1.5
_MOST_FLICKER = 1.0
_ROUNDING = 0.005
"""Share by which two measurements of the same flicker may differ: a code here and there."""
_WEATHERS = ("ClearNoon", "ClearSunset", "ClearNight", "HardRainNoon", "WetNight")
_PATIENCE_S = 3600.0


def check_against(
    revision: str, *, towns: Sequence[str], places: int, width: int, height: int, seed: int
) -> Verdict:
    """Compare pictures of this source with those of a commit, which are rendered, too.

    Args:
        revision: of the commit, as git understands it.
        towns: what is looked at, in five weathers.
        places: of a camera in each town.
        width, height: of the pictures.
        seed: of the actors' places.
    """
    settings = {
        "towns": list(towns), "weathers": list(_WEATHERS), "places": places,
        "width": width, "height": height, "seed": seed,
    }  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="carstage-pictures-") as folder:
        before = _rendered(_source(revision, Path(folder) / "source"), Path(folder), settings)
        after = _rendered(_ROOT, Path(folder), settings)
    names = sorted({name.rsplit(" ", 1)[0] for name in before})
    apart = {
        name: float(
            np.mean([_apart(before[f"{name} {k}"], after[f"{name} {k}"]) for k in range(2)])
        )
        for name in names
    }
    then, now = (float(np.mean([_flicker(one, n) for n in names])) for one in (before, after))
    worst = max(apart, key=apart.__getitem__)
    figures = (
        Figure("against", revision),
        Figure("pictures", 2 * len(names), ">=", 1),
        Figure("mean_difference_delta_e", float(np.mean(list(apart.values()))), "<=", _MOST_APART),
        Figure("largest_mean_difference_delta_e", apart[worst], "<=", _MOST_APART),
        Figure("which", worst),
        Figure("warped_difference_of_two_frames_before_codes", then),
        Figure("warped_difference_of_two_frames_after_codes", now),
        Figure("after_over_before", now / then, "<=", _MOST_FLICKER + _ROUNDING),
    )
    return Verdict("looks-against", figures)


def _source(revision: str, folder: Path) -> Path:
    """The source of a commit, in a new folder."""
    archive = subprocess.run(
        ["git", "archive", revision, "src", "benchmarks"],
        cwd=_ROOT, check=True, capture_output=True,
    ).stdout  # fmt: skip
    folder.mkdir()
    with tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        packed.extractall(folder, filter="data")
    return folder


def _rendered(
    source: Path, folder: Path, settings: dict[str, object]
) -> dict[str, NDArray[np.generic]]:
    """What a process renders with the code below ``source``."""
    found = folder / "pictures.npz"
    subprocess.run(
        [sys.executable, pictures_process.__file__, str(found), json.dumps(settings)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(source / "src"), str(source)])},
        check=True,
        timeout=_PATIENCE_S,
    )
    with np.load(found, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def _apart(one: NDArray[np.generic], other: NDArray[np.generic]) -> float:
    """Mean distance of two pictures' colours, CIE 1976."""
    a, b = lab(one.astype(np.uint8)), lab(other.astype(np.uint8))
    return float(np.linalg.norm(a - b, axis=-1).mean())


def _flicker(pictures: dict[str, NDArray[np.generic]], name: str) -> float:
    """Mean difference of a picture and the one before, moved by the flow, in codes."""
    before = pictures[f"{name} 0"].astype(np.float64)
    after = pictures[f"{name} 1"].astype(np.float64)
    flow = pictures[f"{name} flow"].astype(np.float64)
    height, width = flow.shape[:2]
    y, x = np.mgrid[:height, :width]
    u = x - flow[..., 0] * width / 2.0
    v = y + flow[..., 1] * height / 2.0
    inside = (u >= 0) & (u <= width - 1.001) & (v >= 0) & (v <= height - 1.001)
    u, v = u[inside], v[inside]
    i, j = u.astype(np.int64), v.astype(np.int64)
    a, b = (u - i)[:, None], (v - j)[:, None]
    moved = (before[j, i] * (1 - a) + before[j, i + 1] * a) * (1 - b) + (
        before[j + 1, i] * (1 - a) + before[j + 1, i + 1] * a
    ) * b
    return float(np.abs(moved - after[inside]).mean())
