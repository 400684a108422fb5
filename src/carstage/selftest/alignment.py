"""Do pictures show the world of their own tick?

Each question is asked at several lags: if pictures came a tick late, another lag than none would
explain them better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from carstage.selftest.depth_view import CLEARLY, EXPLAINS, LAGS, DepthView, pairs
from carstage.selftest.evidence import Body, Evidence
from carstage.selftest.verdict import Check
from carstage.selftest.warping import inside_box
from carstage.sensor_kinds.columns import Bgra

_OWN = "those of their own tick"
_LIKE = 30
_EDGE_PX = 3
_GROUND_M = 0.15
_SURFACE_M = 0.05
_FEWEST = 10


def check_poses(view: DepthView) -> Check:
    """The camera's pictures show what its pose of the same tick sees."""
    shares = {lag: view.fit(lag) for lag in LAGS}
    lag = max(shares, key=lambda candidate: shares[candidate])
    others = max(share for other, share in shares.items() if other != lag)
    sure = shares[lag] >= EXPLAINS and shares[lag] >= CLEARLY * others
    found = _words(lag) if sure else "no tick's for certain"
    return Check("camera poses", sure and lag == 0, found, _OWN, shares[lag])


def check_pictures(view: DepthView, name: str) -> Check:
    """A camera's pictures are of the same ticks as the depth camera's.

    Judged by edges: along them, what is a pixel further on looks different.
    """
    pictures = view.evidence.pictures[name]
    alike = _RULES[name]
    shares = {lag: _likeness(view, pictures, alike, lag) for lag in LAGS[:3]}
    lag = max(shares, key=lambda candidate: shares[candidate])
    others = max(share for other, share in shares.items() if other != lag)
    sure = shares[lag] > others
    # Where the picture a tick later fits, a picture shows the tick before its own.
    found = _words(-lag) if sure else "no tick's for certain"
    return Check(f"{name} pictures", sure and lag == 0, found, _OWN, shares[lag])


def check_actors(view: DepthView) -> Check:
    """The vehicle ahead is seen where the snapshot of the same tick has it."""
    evidence = view.evidence
    seen = {lag: list(_seen_in_box(view, evidence.vehicle, lag)) for lag in LAGS}
    own = sum(count for _, count in seen[0])
    # Lags leave out ticks at an end: each is measured against the same ticks without a lag.
    by_tick = dict(seen[0])
    shares = {
        lag: sum(count for _, count in found) / max(1, sum(by_tick[tick] for tick, _ in found))
        for lag, found in seen.items()
    }
    expected = "where the snapshot of their own tick has them"
    if own < _FEWEST * evidence.ticks:
        return Check("actor poses", False, "the vehicle is not in its box", expected, 0.0)
    lag = max(shares, key=lambda candidate: shares[candidate])
    found = expected if lag == 0 else f"where the snapshot {_offset(lag)} has them"
    others = max(share for other, share in shares.items() if other != 0)
    return Check("actor poses", lag == 0, found, expected, 1.0 - others)


def _seen_in_box(view: DepthView, body: Body, lag: int) -> Iterator[tuple[int, int]]:
    """Tick, and how many pixels of its picture show what lies in the box of a later tick."""
    for tick, points in enumerate(view.points):
        if 0 <= tick + lag < view.evidence.ticks:
            box = body.world_from_box[tick + lag]
            above_road = points[:, 2] > box[2, 3] - body.extent[2] + _GROUND_M
            yield tick, int(np.sum(inside_box(points, box, body.extent, _SURFACE_M) & above_road))


Alike = Callable[[NDArray[np.uint8], NDArray[np.uint8]], NDArray[np.bool_]]


def _colours_alike(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.bool_]:
    difference = np.abs(first[..., :3].astype(np.int64) - second[..., :3].astype(np.int64))
    return np.asarray(difference.sum(axis=-1) <= _LIKE, dtype=np.bool_)


def _tags_alike(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray(first[..., Bgra.RED] == second[..., Bgra.RED], dtype=np.bool_)


def _ids_alike(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray((first[..., :3] == second[..., :3]).all(axis=-1), dtype=np.bool_)


_RULES: dict[str, Alike] = {
    "rgb": _colours_alike,
    "semantic": _tags_alike,
    "instance": _ids_alike,
}
PICTURES = tuple(_RULES)


def _likeness(view: DepthView, pictures: NDArray[np.uint8], alike: Alike, lag: int) -> float:
    """Share of edge pixels that look alike where they reappear, if pictures lag so many ticks."""
    found = []
    for tick, other in pairs(view.evidence.ticks, lag):
        first, second = pictures[tick + lag], pictures[other + lag]
        moved = view.warp(tick, other)
        edge = _edges(first, alike)[moved.source[:, 0], moved.source[:, 1]]
        here = first[moved.source[edge, 0], moved.source[edge, 1]]
        there = second[moved.target[edge, 0], moved.target[edge, 1]]
        if edge.any():
            found.append(float(np.mean(alike(here, there))))
    return float(np.mean(found)) if found else 0.0


def _edges(picture: NDArray[np.uint8], alike: Alike) -> NDArray[np.bool_]:
    """``(H, W)`` pixels that differ from the one a little to the right or below."""
    edge = np.zeros(picture.shape[:2], dtype=np.bool_)
    edge[:, :-_EDGE_PX] |= ~alike(picture[:, :-_EDGE_PX], picture[:, _EDGE_PX:])
    edge[:-_EDGE_PX] |= ~alike(picture[:-_EDGE_PX], picture[_EDGE_PX:])
    return edge


def _words(lag: int) -> str:
    return _OWN if lag == 0 else f"those of {_offset(lag)}"


def _offset(lag: int) -> str:
    count = abs(lag)
    return f"{count} tick{'s' if count > 1 else ''} {'before' if lag < 0 else 'after'}"


def available(evidence: Evidence) -> Iterator[str]:
    """Cameras whose pictures can be compared."""
    yield from (name for name in PICTURES if name in evidence.pictures)
