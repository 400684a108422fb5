"""Samples an OpenDRIVE file with the client's own map reader; runs as a process of its own.

``python -m carstage_sim.maps.opendrive IN.xodr OUT.npz``. This is the only module of the simulator
that imports ``carla``: whatever the client believes about a map, the server then believes too, and
the server process itself stays free of the wheel.
"""

from __future__ import annotations

import sys
from pathlib import Path

import carla
import numpy as np
from lxml import etree

from carstage_sim.maps.strips import LANE_KINDS, MARK_KINDS

STEP_M = 1.0
_END_M = 1e-4
"""Lane ends are sampled this far inside: beyond them the client has no waypoint."""


def sample(opendrive: str, name: str) -> dict[str, np.ndarray]:
    """Samples of all lanes, about a metre apart, and the crosswalk outlines.

    Returns:
        Columns of lane samples, one row each: ``location`` (N, 3) m and ``rotation_deg`` (N, 3),
        along the direction of travel, in CARLA's frame; ``width_m``, ``s_m``, ``road_id``,
        ``section_id``, ``lane_id``, ``junction_id``, ``lane_kind`` (index into ``LANE_KINDS``),
        ``speed_limit_kmh`` (0 where the file gives none); ``inner_mark`` and ``outer_mark`` (N, 2)
        kind (index into ``MARK_KINDS``) and 1 for yellow; ``mark_width_m`` (N, 2) of those two.
        ``crosswalk`` (M, 3): closed outlines, one after the other.
    """
    town = carla.Map(name, opendrive)
    columns: dict[str, list[object]] = {
        key: []
        for key in (
            "location", "rotation_deg", "width_m", "s_m", "road_id", "section_id", "lane_id",
            "junction_id", "lane_kind", "speed_limit_kmh", "inner_mark", "outer_mark",
            "mark_width_m",
        )
    }  # fmt: skip
    for road in etree.fromstring(opendrive.encode()).iterfind("road"):
        road_id, junction_id = int(road.get("id")), int(road.get("junction"))
        sections = road.findall("lanes/laneSection")
        starts = [float(section.get("s")) for section in sections] + [float(road.get("length"))]
        road_limit = road.find("type/speed")
        for section_id, section in enumerate(sections):
            begin, end = starts[section_id], starts[section_id + 1]
            count = max(2, int(np.ceil((end - begin) / STEP_M)) + 1)
            stations = np.linspace(begin + _END_M, end - _END_M, count)
            for lane in section.iterfind("*/lane"):
                if lane.get("type") not in LANE_KINDS:
                    continue
                limit = lane.find("speed") if lane.find("speed") is not None else road_limit
                for s_m in stations:
                    waypoint = town.get_waypoint_xodr(road_id, int(lane.get("id")), float(s_m))
                    if waypoint is None:
                        continue
                    place, turn = waypoint.transform.location, waypoint.transform.rotation
                    inner, outer = waypoint.left_lane_marking, waypoint.right_lane_marking
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
                        "speed_limit_kmh": _kmh(limit),
                        "inner_mark": _mark(inner),
                        "outer_mark": _mark(outer),
                        "mark_width_m": (inner.width, outer.width),
                    }
                    for key, value in row.items():
                        columns[key].append(value)
    whole = {"road_id", "section_id", "lane_id", "junction_id", "lane_kind"}
    whole |= {"inner_mark", "outer_mark"}
    arrays = {
        key: np.array(values, dtype=np.int32 if key in whole else np.float64)
        for key, values in columns.items()
    }
    outline = [(p.x, p.y, p.z) for p in town.get_crosswalks()]
    arrays["crosswalk"] = np.array(outline, dtype=np.float64).reshape(-1, 3)
    return arrays


def _kmh(speed: etree._Element | None) -> float:
    if speed is None or not str(speed.get("max")).replace(".", "", 1).isdigit():
        return 0.0
    factor = {"km/h": 1.0, "mph": 1.609344}.get(speed.get("unit", "m/s"), 3.6)
    return float(speed.get("max")) * factor


def _mark(marking: carla.LaneMarking) -> tuple[int, int]:
    kind = str(marking.type)
    # Kinds without a drawing of their own (botts dots, grass …) are left blank.
    code = MARK_KINDS.index(kind) if kind in MARK_KINDS else 0
    return code, int(str(marking.color) == "Yellow")


def main(arguments: list[str]) -> int:
    """Reads the first path, writes the second."""
    source, target = Path(arguments[0]), Path(arguments[1])
    np.savez(target, allow_pickle=False, **sample(source.read_text(encoding="utf-8"), source.stem))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
