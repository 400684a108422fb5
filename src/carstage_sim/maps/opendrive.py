"""Samples an OpenDRIVE file with the client's own map reader; runs in a separate process.

``python -m carstage_sim.maps.opendrive IN.xodr OUT.npz``. This is the only module of the simulator
that imports ``carla``: whatever the client believes about a map, the server then believes too, and
the server process itself stays free of the wheel.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import carla
import numpy as np
from lxml import etree
from numpy.typing import NDArray

from carstage_sim.maps.checking import root_of
from carstage_sim.maps.road_objects import (
    Place,
    ReferenceAt,
    arrow,
    crosswalk,
    lane_offset,
    number_of,
    to_left,
)
from carstage_sim.maps.signals import TRIGGER_GAP_M, TRIGGER_LENGTH_M
from carstage_sim.maps.strips import LANE_KINDS, MARK_KINDS, OTHER_WAY_ROUND

STEP_M = 1.0
_COARSE_STEP_M = 2.0
_LARGE_MAP_M = 150_000.0
"""Maps with more road than this are sampled coarsely."""
_END_M = 1e-4
"""Lane ends are sampled this far inside: beyond them the client has no waypoint."""
_AFTER_M = 2e-3
"""Lines are read this far behind where they begin: the client's stations have single precision."""
_APART_M = 0.1
"""Places where lines change that are closer to each other, or to an end, are sampled as one."""
_LONGEST_WAY_M = 100
"""No way through a junction is longer."""
_TURN_DEG = 45.0
_DIGITS = re.compile(r"[0-9]+")
_KMH_OF = {"mph": 1.609344, "m/s": 3.6}
_LARGEST_NUMBER = 1000.0
"""On a sign."""


def sample(opendrive: str, name: str) -> dict[str, np.ndarray]:
    """Samples of all lanes, about a metre apart, crosswalks, signals and what lanes lead to.

    Returns:
        Columns of lane samples, one row each: ``location`` (N, 3) m and ``rotation_deg`` (N, 3),
        along the direction of travel, in CARLA's frame; ``width_m``, ``s_m``, ``road_id``,
        ``section_id``, ``lane_id``, ``junction_id``, ``lane_kind`` (index into ``LANE_KINDS``),
        ``inner_mark`` and ``outer_mark`` (N, 2)
        kind (index into ``MARK_KINDS``) and 1 for yellow; ``mark_width_m`` (N, 2) of those two;
        ``station`` (N,): rows of one cross-section have one number, ascending along each section.
        ``crosswalk`` (M, 3): corners of outlines; ``crosswalk_number`` (M,): of which outline.
        ``record``: JSON, uint8, see :mod:`carstage_sim.maps.signals`.
    """
    town = carla.Map(name, opendrive)
    root = root_of(opendrive)
    from_left = _is_road_runner(root)
    columns: dict[str, list[object]] = {
        key: []
        for key in (
            "location", "rotation_deg", "width_m", "s_m", "road_id", "section_id", "lane_id",
            "junction_id", "lane_kind", "inner_mark", "outer_mark",
            "mark_width_m", "station",
        )
    }  # fmt: skip
    roads = root.findall("road")
    lengths = {int(road.get("id")): float(road.get("length")) for road in roads}
    whole_m = sum(float(road.get("length")) for road in roads)
    step_m = STEP_M if whole_m < _LARGE_MAP_M else _COARSE_STEP_M
    first_station = 0
    for road in roads:
        road_id, junction_id = int(road.get("id")), int(road.get("junction"))
        sections = road.findall("lanes/laneSection")
        starts = [float(section.get("s")) for section in sections] + [float(road.get("length"))]
        for section_id, section in enumerate(sections):
            begin, end = starts[section_id], starts[section_id + 1]
            if end - begin < 4 * _END_M:
                continue
            stations = _stations(section, begin, end, step_m)
            for lane in section.iterfind("*/lane"):
                if lane.get("type") not in LANE_KINDS or lane.get("id") == "0":
                    continue
                for number, s_m in enumerate(stations):
                    waypoint = town.get_waypoint_xodr(road_id, int(lane.get("id")), float(s_m))
                    if waypoint is None:
                        continue
                    place, turn = waypoint.transform.location, waypoint.transform.rotation
                    inner, outer = waypoint.left_lane_marking, waypoint.right_lane_marking
                    on_left = waypoint.lane_id if from_left else 0
                    row = {
                        "location": (place.x, place.y, place.z),
                        "rotation_deg": (turn.pitch, turn.yaw, turn.roll),
                        "width_m": waypoint.lane_width,
                        "s_m": waypoint.s,
                        "road_id": road_id,
                        "section_id": section_id,
                        "lane_id": waypoint.lane_id,
                        "junction_id": junction_id,
                        "lane_kind": LANE_KINDS.index(lane.get("type")),
                        "inner_mark": _mark(inner, turned=on_left > 1),
                        "outer_mark": _mark(outer, turned=on_left > 0),
                        "mark_width_m": (_mark_width(inner), _mark_width(outer)),
                        "station": first_station + number,
                    }
                    for key, value in row.items():
                        columns[key].append(value)
            first_station += len(stations)
    whole = {"road_id", "section_id", "lane_id", "junction_id", "lane_kind"}
    whole |= {"inner_mark", "outer_mark", "station"}
    pairs = {"inner_mark", "outer_mark", "mark_width_m"}
    width = dict.fromkeys(pairs, 2) | {"location": 3, "rotation_deg": 3}
    arrays = {
        key: np.array(values, dtype=np.int32 if key in whole else np.float64).reshape(
            (-1, width[key]) if key in width else (-1,)
        )
        for key, values in columns.items()
    }
    walks = _crosswalks(town, roads)
    corners = [corner for walk in walks for corner in walk]
    arrays["crosswalk"] = np.array(corners, dtype=np.float64).reshape(-1, 3)
    numbers = [number for number, walk in enumerate(walks) for _ in walk]
    arrays["crosswalk_number"] = np.array(numbers, dtype=np.int32)
    origin = town.transform_to_geolocation(carla.Location())
    record = {
        "geo_reference": (origin.latitude, origin.longitude),
        "signals": _signals(town, root, lengths),
        "controllers": _controllers(root),
        "turns": _turns(town),
        "arrows": _arrows(town, roads),
    }
    text = json.dumps(record, sort_keys=True).encode()
    arrays["record"] = np.frombuffer(text, dtype=np.uint8)
    return arrays


def _stations(
    section: etree._Element, begin_m: float, end_m: float, step_m: float
) -> NDArray[np.float64]:
    """Where a lane section is sampled: evenly, and where a line along it changes."""
    count = max(2, math.ceil((end_m - begin_m) / step_m) + 1)
    even = np.linspace(begin_m + _END_M, end_m - _END_M, count)
    low_m, high_m = begin_m + _APART_M, end_m - _APART_M
    changes: list[float] = []
    offsets = {number_of(mark, "sOffset") for mark in section.iterfind("*/lane/roadMark")}
    for offset_m in sorted(offsets, reverse=True):
        at_m = min(max(begin_m + offset_m, low_m), high_m) + _AFTER_M
        if 0.0 < offset_m < end_m - begin_m and (not changes or changes[-1] - at_m > _APART_M):
            changes.append(at_m)
    if not changes or high_m < low_m:
        return even
    places = np.concatenate([[-np.inf], changes[::-1], [np.inf]])
    after = np.searchsorted(places, even)
    is_free = np.minimum(even - places[after - 1], places[after] - even) > _APART_M / 2
    is_free[[0, -1]] = True
    return np.sort(np.concatenate([even[is_free], changes]))


def _outermost(roads: list[etree._Element]) -> dict[int, int]:
    """The largest number of a lane on either side, by road."""
    return {
        int(road.get("id")): max(
            (abs(int(lane.get("id"))) for lane in road.iterfind("lanes/laneSection/*/lane")),
            default=0,
        )
        for road in roads
    }


def _reference(town: carla.Map, road: etree._Element) -> ReferenceAt:
    """The place of a road's reference line by its station."""
    road_id, length_m = int(road.get("id")), float(road.get("length"))

    def reference_at(s_m: float) -> tuple[Place, float] | None:
        inside = min(max(s_m, _END_M), length_m - _END_M)
        middle = town.get_waypoint_xodr(road_id, 0, inside)
        if middle is None:
            return None
        offset_m, slope = lane_offset(road, inside)
        # The client turns the middle lane by the slope itself, not by the angle of it.
        heading = math.radians(middle.transform.rotation.yaw) + slope
        return to_left(_place(middle), heading, -offset_m), heading

    return reference_at


def _crosswalks(town: carla.Map, roads: list[etree._Element]) -> list[list[Place]]:
    found = [
        crosswalk(element, _reference(town, road))
        for road in roads
        for element in road.iterfind("objects/object")
    ]
    return [corners for corners in found if corners]


def _arrows(town: carla.Map, roads: list[etree._Element]) -> list[dict[str, Any]]:
    found = [
        arrow(element, _reference(town, road))
        for road in roads
        for element in road.iterfind("objects/object")
    ]
    return [one for one in found if one is not None]


def _signals(
    town: carla.Map, root: etree._Element, lengths: dict[int, float]
) -> list[dict[str, Any]]:
    """Every signal once, with all lanes that it or a reference to it governs."""
    outermost = _outermost(root.findall("road"))
    # The client takes objects named Speed_N for signs in mph, though CARLA drives N km/h there.
    signals = {signal.get("id") for signal in root.iterfind("road/signals/signal")}
    found: dict[str, dict[str, Any]] = {}
    for landmark in town.get_all_landmarks():
        entry = found.get(landmark.id)
        if entry is None:
            pose = landmark.transform
            unit = landmark.unit if landmark.id in signals else ""
            entry = found[landmark.id] = {
                "signal_id": landmark.id,
                "kind": landmark.type,
                "value": _number(landmark.value, unit, landmark.sub_type, landmark.name),
                "location": (pose.location.x, pose.location.y, pose.location.z),
                "yaw_deg": pose.rotation.yaw,
                "lanes": [],
            }
        most = outermost.get(landmark.road_id, 0)  # a file may name a billion lanes
        for first, last in landmark.get_lane_validities():
            for lane_id in range(max(min(first, last), -most), min(max(first, last), most) + 1):
                length_m = lengths.get(landmark.road_id, 0.0)
                lane = _governed(town, landmark.road_id, lane_id, landmark.s, length_m)
                if lane is not None and lane not in entry["lanes"]:
                    entry["lanes"].append(lane)
    return [found[key] for key in sorted(found)]


def _number(value: float, unit: str, *texts: str) -> float:
    """What a sign says: its value, else the digits of its subtype or name, else -1; speeds in km/h.

    A text below 0, as in ``subtype="-1"``, says nothing.
    """
    for text in texts:
        if value > 0.0:
            break
        if not text.startswith("-"):
            value = float(next(iter(_DIGITS.findall(text)), value))
    return float(value) * _KMH_OF.get(unit, 1.0) if 0.0 < value <= _LARGEST_NUMBER else -1.0


def _governed(
    town: carla.Map, road_id: int, lane_id: int, s_m: float, length_m: float
) -> dict[str, Any] | None:
    """A driving lane at the place where a signal holds, and the middle of the stretch before."""
    if lane_id == 0:
        return None
    point = town.get_waypoint_xodr(road_id, lane_id, s_m)
    if point is None:
        for inside in (s_m + 2 * _END_M, s_m - 2 * _END_M):
            point = point or town.get_waypoint_xodr(road_id, lane_id, max(inside, 0.0))
    if point is None or point.lane_type != carla.LaneType.Driving:
        return None
    line = point
    if point.is_junction:  # as in the vector map: who stops, stops before the junction
        begin_m = _END_M if lane_id < 0 else length_m - _END_M
        line = town.get_waypoint_xodr(road_id, lane_id, begin_m) or point
    before = _earlier(_entrance(point), TRIGGER_GAP_M + TRIGGER_LENGTH_M / 2)
    junction_id = point.junction_id if point.is_junction else -1
    if junction_id == -1:
        onward = [w for w in point.next(12.0) if w.is_junction]
        junction_id = onward[0].junction_id if onward else -1
    return {
        "road_id": road_id,
        "lane_id": lane_id,
        "junction_id": junction_id,
        "width_m": point.lane_width,
        "stop": _place(point),
        "before": _place(before),
        "before_yaw_deg": before.transform.rotation.yaw,
        "yaw_deg": point.transform.rotation.yaw,
        "line": _place(line),
        "line_yaw_deg": line.transform.rotation.yaw,
    }


def _entrance(point: carla.Waypoint) -> carla.Waypoint:
    """The point itself, or the one where its lane enters the junction that it lies in."""
    for _ in range(_LONGEST_WAY_M):
        if not point.is_junction:
            break
        point = _earlier(point, 1.0)
    return point


def _earlier(point: carla.Waypoint, distance_m: float) -> carla.Waypoint:
    """The straightest way back; the point itself where the lane begins sooner."""
    yaw = point.transform.rotation.yaw
    behind = point.previous(distance_m)
    return min(behind, key=lambda w: abs(_wrapped(w.transform.rotation.yaw - yaw)), default=point)


def _place(waypoint: carla.Waypoint) -> Place:
    place = waypoint.transform.location
    return place.x, place.y, place.z


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0


def _controllers(root: etree._Element) -> list[dict[str, Any]]:
    """Controllers of lights in each junction, in the order in which they get green."""
    signals = {
        controller.get("id"): [c.get("signalId") for c in controller.iterfind("control")]
        for controller in root.iterfind("controller")
    }
    found = []
    for junction in root.iterfind("junction"):
        named = [c for c in junction.iterfind("controller") if c.get("id") in signals]
        # Sorting keeps the file's order where the sequence is missing or equal.
        named.sort(key=lambda c: _kept(c.get("sequence")))
        found += [
            {"junction_id": int(junction.get("id")), "signals": signals[c.get("id")]} for c in named
        ]
    return found


def _kept(sequence: str | None) -> int:
    return int(sequence) if sequence and sequence.isdigit() else 0


def _turns(town: carla.Map) -> list[tuple[int, int, list[str]]]:
    """Road, lane and the ways on through the junction at the lane's end."""
    found: dict[tuple[int, int], set[str]] = defaultdict(set)
    for begin, end in town.get_topology():
        if not begin.is_junction:
            continue
        angle = _wrapped(end.transform.rotation.yaw - begin.transform.rotation.yaw)
        turn = "straight" if abs(angle) < _TURN_DEG else "right" if angle > 0 else "left"
        for source in begin.previous(1.0):
            if not source.is_junction:
                found[source.road_id, source.lane_id].add(turn)
    return [(road, lane, sorted(turns)) for (road, lane), turns in sorted(found.items())]


def _is_road_runner(root: etree._Element) -> bool:
    """Whether RoadRunner wrote a file, as those of CARLA's towns.

    It names the strokes of double lines from left to right on both sides of a road, the standard
    from inside to outside. So say the turn lanes in the middle of Town03's roads.
    """
    return any(scene.get("program") == "RoadRunner" for scene in root.iter("vectorScene"))


def _mark(marking: carla.LaneMarking | None, *, turned: bool) -> tuple[int, int]:
    """Kind and colour of a line; ``turned``: its strokes are named from outside to inside."""
    if marking is None:
        return 0, 0
    kind = str(marking.type)
    kind = OTHER_WAY_ROUND.get(kind, kind) if turned else kind
    # Kinds without a drawing of their own (botts dots, grass …) are left blank.
    code = MARK_KINDS.index(kind) if kind in MARK_KINDS else 0
    return code, int(str(marking.color) == "Yellow")


def _mark_width(marking: carla.LaneMarking | None) -> float:
    return 0.0 if marking is None else float(marking.width)


def main(arguments: list[str]) -> int:
    """Reads the first path, writes the second; says on stderr in one line why it cannot."""
    source, target = Path(arguments[0]), Path(arguments[1])
    try:
        arrays = sample(source.read_text(encoding="utf-8"), source.stem)
    except (RuntimeError, ValueError, TypeError, LookupError, AttributeError) as error:
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        return 1
    np.savez(target, allow_pickle=False, **arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
