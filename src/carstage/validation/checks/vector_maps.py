"""Whether the vector maps that episodes name are those of their towns' OpenDRIVE texts."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from carstage.dataset.maps import vector_map_outlines
from carstage.dataset.reading import Episode
from carstage.errors import DatasetError, VectorMapError
from carstage.geometry import FloatArray, GeoFrame
from carstage.validation.checks.findings import Findings
from carstage.vector_map import Junction, Lane, VectorMap, vector_map

_CLOSE_M = 0.025
"""Twice what a chord may be off its curve, and some."""
_KINDS = (
    "lanes", "markings", "junctions", "crosswalks", "stop_lines", "signals", "painted_objects",
)  # fmt: skip


class VectorMapChecks:
    """Reads and makes each map once, however many episodes name it."""

    def __init__(self) -> None:
        self._verdicts: dict[str, str | None] = {}

    def check(self, episode: Episode, findings: Findings) -> None:
        """The map is there, holds together, and is what the town's OpenDRIVE text says."""
        try:
            named = episode.document.get("vector_map")
            problem = episode.document.get("vector_map_problem")
        except DatasetError:
            return  # the checks of the episode say so
        if problem is not None:
            message = f"the town has no vector map: {str(problem)[:500]}"
            findings.add("vector_map", message, severity="warning")
        if named is None:
            return
        # A dataset from elsewhere may name it by anything.
        key = repr(
            (named, episode.document.get("opendrive"), episode.document.get("geo_reference"))
        )
        if key not in self._verdicts:
            self._verdicts[key] = _verdict(episode)
        verdict = self._verdicts[key]
        if verdict is not None:
            findings.add("vector_map", verdict)


def _verdict(episode: Episode) -> str | None:
    try:
        stored, text, frame = episode.vector_map(), episode.opendrive(), episode.geo_frame
        if stored is None:
            return None
        if text is None:
            return "there is a vector map, but no OpenDRIVE text that it could be of"
        return (
            _loose_ends(stored)
            or _misplaced(vector_map_outlines(episode.folder, episode.document), stored, frame)
            or _other(stored, vector_map(text))
        )
    except (DatasetError, VectorMapError) as error:
        return str(error)


def _loose_ends(town: VectorMap) -> str | None:
    """The first reference that leads nowhere, or not back."""
    lanes, markings = town.lane_by_id, town.marking_by_id
    signals = {signal.id for signal in town.signals}
    for lane in town.lanes:
        beside = {one for one in (lane.left_neighbour, lane.right_neighbour) if one is not None}
        for other in (*lane.successors, *lane.predecessors, *beside):
            if other not in lanes:
                return f"lane {lane.id} names lane {other[:40]!r}, which is not there"
        if any(lane.id not in lanes[other].predecessors for other in lane.successors):
            return f"lane {lane.id} leads to a lane that does not name it"
        for other in (*lane.left_markings, *lane.right_markings):
            if other not in markings:
                return f"lane {lane.id} names marking {other[:40]!r}, which is not there"
    named = [("marking", one.id, one.lanes) for one in town.markings]
    named += [("stop line", one.id, one.lanes) for one in town.stop_lines]
    named += [("signal", one.id, one.lanes) for one in town.signals]
    named += [("painted object", one.id, one.lanes) for one in town.painted_objects]
    for what, name, others in named:
        if any(other not in lanes for other in others):
            return f"{what} {name} names a lane that is not there"
    for stop in town.stop_lines:
        if any(other not in signals for other in stop.signals):
            return f"stop line {stop.id} names a signal that is not there"
    return None


def _misplaced(
    outlines: Iterable[tuple[str, FloatArray, FloatArray]], town: VectorMap, frame: GeoFrame
) -> str | None:
    """The first feature that is elsewhere on the globe than in the world."""
    count = 0
    for name, on_the_globe, world in outlines:
        count += 1
        expected = frame.places(world)
        either = (expected, expected[::-1])
        if not any(
            one.shape == on_the_globe.shape
            and np.allclose(one[:, :2], on_the_globe[:, :2], rtol=0.0, atol=1e-8)
            and np.allclose(one[:, 2], on_the_globe[:, 2], rtol=0.0, atol=1e-3)
            for one in either
        ):
            return f"{name} is not where the episode's geo_reference puts it"
    if count < len(town.lanes):
        return "lanes have no geometry on the globe"
    return None


def _other(stored: VectorMap, made: VectorMap) -> str | None:
    """The first difference of the stored map from what the OpenDRIVE text says."""
    for kind in _KINDS:
        ids, expected = (
            [_id(feature) for feature in getattr(town, kind)] for town in (stored, made)
        )
        if ids != expected:
            return f"its {kind.replace('_', ' ')} are not those of the OpenDRIVE text"
    for kind in _KINDS:
        for one, other in zip(getattr(stored, kind), getattr(made, kind), strict=True):
            name = f"{kind.replace('_', ' ')[:-1]} {_id(one)}"
            if _words_of(one) != _words_of(other):
                return f"{name} is not what the OpenDRIVE text says"
            if not _apart_m(one, other) <= _CLOSE_M:  # NaN is nowhere
                return f"{name} is not where the OpenDRIVE text puts it"
    return None


def _words_of(feature: Any) -> dict[str, object]:
    """The attributes of a feature that have to be equal."""
    names = set(feature.__slots__) - _places_of(feature).keys()
    return {name: getattr(feature, name) for name in names}


def _places_of(feature: Any) -> dict[str, FloatArray]:
    """The attributes of a feature in metres, which rounding and chords may change a little."""
    values = ((name, getattr(feature, name)) for name in feature.__slots__)
    return {name: value for name, value in values if isinstance(value, np.ndarray)}


def _apart_m(one: Any, other: Any) -> float:
    """How far a feature is from another one with its id and its words."""
    if isinstance(one, Lane) and not np.array_equal(one.s_m, other.s_m):
        return float(np.max([_off_m(one, other), _off_m(other, one)]))
    theirs = _places_of(other)
    apart = [
        np.inf if a.shape != theirs[name].shape else np.abs(a - theirs[name]).max(initial=0.0)
        for name, a in _places_of(one).items()
    ]
    return float(np.max(apart, initial=0.0))


def _off_m(lane: Lane, other: Lane) -> float:
    """How far a lane is, at its own stations, from another one that has others."""
    along, order = np.sort(lane.s_m), np.argsort(lane.s_m)
    theirs = np.argsort(other.s_m)
    apart = [
        np.interp(along, other.s_m[theirs], getattr(other, name)[theirs, axis])
        - getattr(lane, name)[order, axis]
        for name in ("centre_line", "left_boundary", "right_boundary")
        for axis in range(3)
    ]
    apart.append(np.interp(along, other.s_m[theirs], other.width_m[theirs]) - lane.width_m[order])
    return float(np.abs(apart).max())


def _id(feature: Any) -> Any:
    return feature.junction_id if isinstance(feature, Junction) else feature.id
