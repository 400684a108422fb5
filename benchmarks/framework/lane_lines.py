"""Does the vector map have what is painted on the road?

Drives are recorded in each town with lines in pictures, tags and depth. Each pixel that the
semantic picture calls a road line, up to 40 m away, is looked for near the outlines of markings,
stop lines, crosswalks and painted objects such as arrows: polygons of Shapely, of the lines' own
places in metres of the camera.
"""

from __future__ import annotations

import gzip
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from benchmarks.framework.recorded import record
from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Episode, Frame
from carstage.geometry import FloatArray
from carstage.lane_lines.town import AREAS
from carstage.tags import TAGS_0_9_14

BUILT_IN = ("Stage01", "Stage02", "Stage03")
TOWNS = (*BUILT_IN, "Town07", "Town10HD")
TARGET_SHARE = 0.98
FARTHEST_M = 40.0
NEAR_PX = 3.0
_ROAD_LINE = next(value for value, tag in TAGS_0_9_14.items() if tag.name == "RoadLine")
_UNKNOWN_WIDTH_M = 0.15
_POSE = {"x": 1.5, "z": 1.6}
_CONFIG = {
    "seed": 11,
    "fps": 2,
    "vehicles": {"count": 0},
    "pedestrians": {"count": 0},
    "image_size": [640, 360],
    "conversion": {"workers": 1},
    "labels": {"lane_lines": True, "method": "stage_vo"},
    "rig": {
        "sensors": [
            {"id": kind.upper(), "kind": kind, "pose": _POSE}
            for kind in ("rgb", "semantic", "depth")
        ]
    },
}


def measure_lane_lines(
    towns: Sequence[str] = TOWNS,
    seconds: float = 8.0,
    drives: int = 4,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record and compare.

    Args:
        towns: built-in ones, or CARLA's of which py123d carries the OpenDRIVE text.
        seconds: simulated ones of each drive.
        drives: from places drawn in each town.
        progress: called with the recordings done and their total number.
    """
    figures: list[Figure] = []
    pictures = 0
    with tempfile.TemporaryDirectory(prefix="carstage-lane-lines-") as scratch:
        for number, town in enumerate(towns, start=1):
            folder = Path(scratch) / town
            folder.mkdir()
            asked = {
                **_CONFIG, "map": _map(town, folder), "duration_s": seconds, "episodes": drives
            }  # fmt: skip
            painted = explained = 0
            for episode in Dataset(record(asked, folder)).episodes:
                for found in explained_pixels(episode):
                    painted, explained = painted + found.size, explained + int(found.sum())
                    pictures += 1
            share = explained / painted if painted else 0.0
            figures += [
                Figure(f"road_line_pixels_{town}", painted, ">=", 1000),
                Figure(f"explained_share_{town}", share, ">=", TARGET_SHARE),
            ]
            progress(number, len(towns))
    return Verdict(
        "lane-lines",
        (Figure("pictures", pictures), *figures),
        (f"Pixels up to {FARTHEST_M:g} m; explained within {NEAR_PX:g} px of an outline.",),
    )


def explained_pixels(episode: Episode) -> Iterator[NDArray[np.bool_]]:
    """Of each picture, whether each pixel of a road line lies near an outline."""
    table = episode.lane_lines()
    assert table is not None
    by_frame: dict[int, list[dict[str, Any]]] = {}
    for row in table.to_pylist():
        by_frame.setdefault(row["k"], []).append(row)
    k_matrix = episode.sensor("RGB").calibration.k
    for frame in episode.iter_frames():
        points = _road_line_pixels(frame)
        outlines = [
            outline
            for row in by_frame.get(frame.k, [])
            for outline in _outlines(row, _up(frame), k_matrix)
        ]
        found = np.zeros(len(points), np.bool_)
        if outlines and len(points):
            tree = shapely.STRtree(outlines)
            near, _ = tree.query(shapely.points(points), predicate="dwithin", distance=NEAR_PX)
            found[near] = True
        yield found


def _road_line_pixels(frame: Frame) -> FloatArray:
    """``(N, 2)`` centres."""
    painted = (frame.read("SEMANTIC") == _ROAD_LINE) & (frame.read("DEPTH") <= FARTHEST_M)
    row, column = np.nonzero(painted)
    return np.asarray(np.stack([column, row], axis=-1) + 0.5, np.float64)


def _up(frame: Frame) -> FloatArray:
    """The world's up in optical axes: right, down, ahead of CARLA's y, -z, x."""
    forward, right, up = frame.world_from_sensor("RGB")[2, :3]
    return np.array([right, -up, forward])


def _outlines(row: dict[str, Any], up: FloatArray, k: FloatArray) -> Iterator[shapely.Geometry]:
    places = np.column_stack([row["x"], row["y"], row["z"]])
    if row["kind"] in AREAS:
        yield _projected(places, k)
    elif row["kind"] == "marking":
        half = (row["width"] or _UNKNOWN_WIDTH_M) / 2
        for begin, end in pairwise(places):
            across = np.cross(end - begin, up)
            across *= half / max(float(np.linalg.norm(across)), 1e-9)
            corners = np.stack([begin - across, end - across, end + across, begin + across])
            corners[:, 2] = np.maximum(corners[:, 2], 0.05)
            yield _projected(corners, k)


def _projected(places: FloatArray, k: FloatArray) -> shapely.Geometry:
    x, y, z = places.T
    uv = np.stack([k[0, 0] * x / z + k[0, 2], k[1, 1] * y / z + k[1, 2]], axis=-1)
    polygon = shapely.Polygon(uv)
    return polygon if polygon.is_valid else shapely.convex_hull(polygon)


def _map(town: str, folder: Path) -> str:
    if town in BUILT_IN:
        return town
    spec = find_spec("py123d")
    if spec is None or not spec.submodule_search_locations:
        raise RuntimeError("py123d, which carries CARLA's maps, is not installed.")
    maps = Path(spec.submodule_search_locations[0]) / "parser" / "opendrive" / "carla_maps"
    path = folder / f"{town}.xodr"
    path.write_bytes(gzip.decompress((maps / f"{town}.xodr.gz").read_bytes()))
    return str(path)
