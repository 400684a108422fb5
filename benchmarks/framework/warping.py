"""Does each picture, warped by the flow of the next, look like that next picture?

Drives through crowds are recorded in each town. A pixel of a picture is compared with the place in
the picture before from where its flow says that it came, and with the same pixel there: of all
pixels, and of those that the instance picture calls a pedestrian's.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.recorded import record
from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict

TOWNS = ("Stage01", "Stage02", "Stage03")
PEDESTRIAN_TAG = 12
LEAST_PX = 100
"""Pedestrians' pixels in a picture that is judged by them."""
_CONFIG = {
    "seed": 5,
    "fps": 20,
    "vehicles": {"count": 20},
    "pedestrians": {"count": 100},
    "image_size": [640, 360],
    "conversion": {"workers": 1},
    "server": {"kind": "embedded", "self_test": "off"},
    "rig": {
        "sensors": [
            {"id": kind.upper(), "kind": kind, "pose": {"x": 1.5, "z": 1.6}}
            for kind in ("rgb", "instance", "flow")
        ]
    },
}

Errors = tuple[float, float]
"""Mean absolute differences (0 to 255) to the warped picture and to the picture itself."""


def _errors(
    before: NDArray[np.uint8],
    now: NDArray[np.uint8],
    flow_px: NDArray[np.float32],
    chosen: NDArray[np.bool_],
) -> Errors:
    """Of the chosen pixels that were in the picture before."""
    height, width = chosen.shape
    v, u = np.nonzero(chosen)
    x, y = u - flow_px[v, u, 0].astype(np.float64), v - flow_px[v, u, 1].astype(np.float64)
    inside = (x >= 0) & (x < width - 1) & (y >= 0) & (y < height - 1)
    v, u, x, y = v[inside], u[inside], x[inside], y[inside]
    i, j = x.astype(np.intp), y.astype(np.intp)
    right, down = (x - i)[:, None], (y - j)[:, None]
    warped = (1 - down) * ((1 - right) * before[j, i] + right * before[j, i + 1]) + down * (
        (1 - right) * before[j + 1, i] + right * before[j + 1, i + 1]
    )
    of_now = now[v, u].astype(np.float64)
    return float(np.abs(warped - of_now).mean()), float(np.abs(before[v, u] - of_now).mean())


def _pictures(dataset: Path) -> Iterator[tuple[Errors, Errors | None]]:
    """Of each picture but the first: all pixels, and pedestrians' if there are enough."""
    (episode,) = Dataset(dataset).episodes
    for before, now in itertools.pairwise(episode.iter_frames()):
        pair = before.read("RGB"), now.read("RGB"), now.read("FLOW")
        people = now.read("INSTANCE")[..., 1] == PEDESTRIAN_TAG
        everything = _errors(*pair, np.ones(people.shape, np.bool_))
        yield everything, _errors(*pair, people) if people.sum() >= LEAST_PX else None


def measure_warping(
    towns: Sequence[str] = TOWNS,
    seconds: float = 3.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record and warp.

    Args:
        towns: names of built-in towns.
        seconds: simulated ones in each.
        progress: called with the recordings done and their total number.
    """
    whole: list[Errors] = []
    people: list[Errors] = []
    with tempfile.TemporaryDirectory(prefix="carstage-warping-") as scratch:
        for number, town in enumerate(towns, start=1):
            folder = Path(scratch) / town
            folder.mkdir()
            found = list(_pictures(record({**_CONFIG, "map": town, "duration_s": seconds}, folder)))
            whole += [everything for everything, _ in found]
            people += [of_people for _, of_people in found if of_people is not None]
            progress(number, len(towns))
    return Verdict(
        "warping",
        (
            Figure("pictures", len(whole), ">=", len(towns)),
            Figure("pictures_not_explained", _worse(whole), "==", 0),
            Figure("error_share_left", _share_left(whole)),
            Figure("pictures_with_pedestrians", len(people), ">=", 1),
            Figure("pictures_whose_pedestrians_are_not_explained", _worse(people), "==", 0),
            Figure("error_share_left_on_pedestrians", _share_left(people)),
        ),
    )


def _worse(errors: Sequence[Errors]) -> int:
    return sum(warped >= plain for warped, plain in errors)


def _share_left(errors: Sequence[Errors]) -> float:
    """Mean error of the warped pictures over that of the plain ones."""
    warped, plain = np.array(errors).reshape(-1, 2).sum(axis=0)
    return float(warped / plain)
