"""How this server writes instance ids and numbers its semantic tags."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.decoding import NO_HIT_M, decode_instance_bgra
from carstage.selftest.depth_view import DepthView
from carstage.selftest.evidence import Body
from carstage.selftest.verdict import Check
from carstage.selftest.warping import inside_box
from carstage.sensor_kinds.columns import Bgra
from carstage.tags import TAGS_0_9_13, TAGS_0_9_14, Tag, tag_table, vehicle_tags, walker_tags

LOW_FIRST = "actor ids, G + 256 B"
HIGH_FIRST = "actor ids, B + 256 G"
NO_ACTORS = "no actor ids"

ENOUGH = 0.8
_SHRUNK_M = -0.03
_TABLES = {"0.9.13": TAGS_0_9_13, "0.9.14": TAGS_0_9_14}
_WORDS = {"0.9.13": "numbered as up to 0.9.13", "0.9.14": "numbered as since 0.9.14"}
_ROAD = {"0.9.13": {"Road", "RoadLine"}, "0.9.14": {"Roads", "RoadLine"}}
_CORRIDOR_M = (3.0, 9.0)
_HALF_WIDTH_M = 1.0
_GROUND_M = 0.7


def check_instance_ids(view: DepthView, *, actor_ids_needed: bool) -> Check:
    """What the instance camera writes where the vehicle ahead is.

    Args:
        view: what the depth camera saw.
        actor_ids_needed: labels of this server's version are made from actor ids.
    """
    evidence = view.evidence
    pictures, wanted = evidence.pictures["instance"], evidence.vehicle.info.id & 0xFFFF
    low_first, high_first = [], []
    for tick, picture in enumerate(pictures):
        ids = view.at(decode_instance_bgra(picture)[0])[_on(view, evidence.vehicle, tick)]
        low_first.append(ids == wanted)
        high_first.append(ids.byteswap() == wanted)
    expected = LOW_FIRST if actor_ids_needed else f"{LOW_FIRST}, or {NO_ACTORS}"
    shares = {LOW_FIRST: _share(low_first), HIGH_FIRST: _share(high_first)}
    found = max(shares, key=lambda name: shares[name])
    share = shares[found]
    if share < ENOUGH:
        return Check("instance ids", not actor_ids_needed, NO_ACTORS, expected, share)
    return Check("instance ids", found == LOW_FIRST, found, expected, share)


def check_tags(view: DepthView, server: str) -> Check:
    """Which table numbers the tags of vehicle, walker, road and sky."""
    seen = _tags_seen(view)
    expected = next(name for name, table in _TABLES.items() if table is tag_table(server))
    shares = {name: _fitting(seen, name, table) for name, table in _TABLES.items()}
    found = max(shares, key=lambda name: shares[name])
    words = _WORDS[found]
    if shares[found] < ENOUGH:
        words = "numbered in no known way: " + ", ".join(
            f"{what} {_usual(tags)}" for what, tags in seen.items()
        )
    ok = found == expected and shares[found] >= ENOUGH
    return Check("semantic tags", ok, words, _WORDS[expected], shares[found])


def _tags_seen(view: DepthView) -> Mapping[str, NDArray[np.uint8]]:
    """Tags of the sampled pixels of all ticks that show something we know, by what it is."""
    seen: dict[str, list[NDArray[np.uint8]]] = {}
    evidence = view.evidence
    for tick, picture in enumerate(evidence.pictures["semantic"]):
        tags = view.at(picture)[:, Bgra.RED]
        shown = {
            "vehicle": _on(view, evidence.vehicle, tick),
            "road": _road_ahead(view, tick),
            "sky": view.optical[tick, :, 2] >= NO_HIT_M,
        }
        if evidence.walker is not None:
            shown["walker"] = _on(view, evidence.walker, tick)
        for what, mask in shown.items():
            seen.setdefault(what, []).append(tags[mask])
    found = {what: np.concatenate(tags) for what, tags in seen.items()}
    return {what: tags for what, tags in found.items() if len(tags)}


def _on(view: DepthView, body: Body, tick: int) -> NDArray[np.bool_]:
    """``(N,)`` sampled pixels that surely show a body."""
    box = body.world_from_box[tick]
    return inside_box(view.points[tick], box, body.extent, _SHRUNK_M)


def _road_ahead(view: DepthView, tick: int) -> NDArray[np.bool_]:
    """``(N,)`` sampled pixels of the ground between the ego and the vehicle ahead."""
    start = view.evidence.world_from_ego[0]
    local = (view.points[tick] - start[:3, 3]) @ start[:3, :3]
    near, far = _CORRIDOR_M
    ahead = (local[:, 0] > near) & (local[:, 0] < far) & (np.abs(local[:, 1]) < _HALF_WIDTH_M)
    return np.asarray(ahead & (np.abs(local[:, 2]) < _GROUND_M), dtype=np.bool_)


def _fitting(seen: Mapping[str, NDArray[np.uint8]], name: str, table: Mapping[int, Tag]) -> float:
    """The least share of pixels of a kind that a table explains."""
    allowed = {
        "vehicle": vehicle_tags(name),
        "walker": walker_tags(name),
        "road": {number for number, tag in table.items() if tag.name in _ROAD[name]},
        "sky": {number for number, tag in table.items() if tag.name == "Sky"},
    }
    return min(
        (float(np.isin(tags, list(allowed[what])).mean()) for what, tags in seen.items()),
        default=0.0,
    )


def _usual(tags: NDArray[np.uint8]) -> int:
    values, counts = np.unique(tags, return_counts=True)
    return int(values[np.argmax(counts)])


def _share(parts: list[NDArray[np.bool_]]) -> float:
    found = np.concatenate(parts)
    return float(found.mean()) if len(found) else 0.0
