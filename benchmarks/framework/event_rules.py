"""What the world's record has to show of each kind of event, whoever moves who takes part."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from carstage.geometry import FloatArray, invert_pose, pose_matrix, transform_points
from carstage.rawlog.reader import WorldFrame

AHEAD_M = 2.5
"""Half the width of what is straight ahead of the ego."""
IN_LANE_M = 1.0
"""So near to the ego's way a car's middle is in the ego's lane."""
OTHER_LANE_M = 2.2
"""That far from it, it is in another one."""
FLASHING = 0x600
"""Both special lamps of ``carla.VehicleLightState``."""
CROSS_DEG = (40.0, 140.0)
"""Between the ways of two that cross."""
JUNCTION_M = 45.0
"""So far from each other lights of one junction stand at most."""
CLOSED_M = 1.6
"""At least that far to the side of a barrier that closes a lane is the next lane."""
FASTER_M_S = 1.0
"""Than it is asked to, the Traffic Manager lets a vehicle drive."""
WAY_M = 120.0
"""So much of the ego's way counts: it may come back on the other side of the road."""


class View:
    """An event's first actor as the ego saw it, tick by tick, from poses of the record.

    Args:
        frames: of the whole episode.
        ego_id: the ego.
        row: of the table of events.
        fps: ticks in a second.

    Attributes:
        came_deg: the ego's yaw when the event was placed; later it may have turned.
    """

    def __init__(
        self, frames: Sequence[WorldFrame], ego_id: int, row: Mapping[str, Any], fps: float
    ) -> None:
        end = len(frames) if row["end_tick"] is None else row["end_tick"] + 1
        self.frames = frames[row["begin_tick"] : end]
        self.fps = fps
        self.actor_id = row["actors"][0]
        self.places = places_of(self.frames, self.actor_id)
        placed = frames[row["placed_tick"]]
        self.came_deg = float(placed.rotation_deg[placed.row(ego_id)][1])
        moved = np.diff(self.places[:, :2], axis=0)
        self.speeds: FloatArray = np.hypot(moved[:, 0], moved[:, 1]) * fps
        self._way = places_of(frames[row["begin_tick"] :], ego_id)[:, :2]
        steps_m = np.hypot(*np.diff(self._way, axis=0).T)
        self.ego_speeds: FloatArray = steps_m[: len(self.speeds)] * fps
        driven_m = np.cumsum(steps_m)
        self._way = self._way[: 1 + np.searchsorted(driven_m, WAY_M)]
        self._ego = [
            invert_pose(pose_matrix(one.location[i], one.rotation_deg[i]))
            for one in self.frames
            for i in [one.row(ego_id)]
        ]

    def seen_m(self, tick: int, by: int | None = None) -> FloatArray:
        """``(3,)`` where the actor is, forward and right of the ego, or of where the ego was."""
        seen = transform_points(self._ego[tick if by is None else by], self.places[tick])
        return np.asarray(seen)

    def lights(self, frame: WorldFrame) -> int:
        """``carla.VehicleLightState`` of the actor."""
        return int(frame.meta["vehicle_lights"].get(str(self.actor_id), 0))

    def signals_near(self, tick: int, within_m: float) -> list[str]:
        """States of the traffic lights near the actor."""
        frame = self.frames[tick]
        states: Mapping[str, str] = frame.meta["traffic_lights"]
        places = [frame.location[frame.row(int(light))] for light in states]
        away_m = [float(np.hypot(*(place - self.places[tick])[:2])) for place in places]
        return [state for state, m in zip(states.values(), away_m, strict=True) if m < within_m]

    def beside_way_m(self) -> FloatArray:
        """How far the actor was from where the ego drove then and next, in each tick."""
        between = self.places[:, None, :2] - self._way[None]
        return np.asarray(np.hypot(between[..., 0], between[..., 1]).min(axis=1))

    def lead_m(self, other_id: int) -> FloatArray:
        """How far the actor was ahead of another one, along the other's heading, in each tick."""
        lead = [
            transform_points(invert_pose(pose_matrix(one.location[i], one.rotation_deg[i])), place)
            for one, place in zip(self.frames, self.places, strict=True)
            for i in [one.row(other_id)]
        ]
        return np.asarray(lead)[:, 0]


def places_of(frames: Sequence[WorldFrame], actor_id: int) -> FloatArray:
    """``(ticks, 3)`` where an actor was."""
    return np.array([one.location[one.row(actor_id)] for one in frames])


def _crossing(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if not asked["trigger_m"] - 4.0 <= ahead_m <= asked["trigger_m"] + 2.0:
        yield f"it stepped out {ahead_m:.1f} m ahead"
    if (right_m > 0.0) != (asked["side"] == "right"):
        yield "it came from the other side"
    if row["end_tick"] is None:
        return
    if view.seen_m(-1, by=0)[1] * right_m > 0.0:
        yield "it did not come to the other side"
    speed_m_s = float(np.median(view.speeds))
    if abs(speed_m_s - asked["speed_m_s"]) > 0.15 * asked["speed_m_s"]:
        yield f"it walked at {speed_m_s:.2f} m/s"


def _leading(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if abs(right_m) > AHEAD_M or not 0.5 * asked["gap_m"] < ahead_m - 4.5 < 2.0 * asked["gap_m"]:
        yield f"it was {ahead_m:.1f} m ahead and {right_m:.1f} m to the right"
    slower = -np.diff(view.speeds) * view.fps
    braking = slower[slower > 0.5]
    if row["end_tick"] is not None and not len(braking):
        yield "it did not brake"
    wanted = asked["deceleration_m_s2"]
    if len(braking) > 2 and abs(np.median(braking) - wanted) > 0.15 * wanted:
        yield f"it braked at {np.median(braking):.1f} m/s²"
    if row["end_tick"] is not None and view.speeds[-2] > 0.1:
        yield "it did not stop"


def _cutting_in(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if abs(right_m) < 1.5:
        yield f"it began {right_m:.1f} m to the right"
    if not 0.5 * asked["gap_m"] < ahead_m - 4.5 < 2.0 * asked["gap_m"] + 1.0:
        yield f"it began {ahead_m:.1f} m ahead"
    moved_over = round(asked["change_s"] * view.fps) + 1
    if moved_over < len(view.places):
        after_m = abs(view.seen_m(moved_over)[1])
        if after_m > AHEAD_M:
            yield f"it ended {after_m:.1f} m beside"


def _standing(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m = view.seen_m(0)[0]
    if not 0.0 < ahead_m <= asked["trigger_m"] + 1.0:
        yield f"it began {ahead_m:.1f} m ahead"
    # Where the road bends, it is straight ahead only once the ego is near.
    seen = [view.seen_m(tick) for tick in range(len(view.places))]
    nearest = min(seen, key=lambda one: float(np.hypot(one[0], one[1])))
    if abs(nearest[1]) > AHEAD_M:
        yield f"it stood {nearest[1]:.1f} m to the right of the ego"
    if view.speeds.max(initial=0.0) > 0.05:
        yield "it moved"
    if row["end_tick"] is not None and abs(row["end_s"] - row["begin_s"] - asked["stand_s"]) > 0.21:
        yield f"it stood {row['end_s'] - row['begin_s']:.1f} s"


def _overtaking(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    away_m = float(np.hypot(*view.seen_m(0)[:2]))
    if not asked["distance_m"] - 4.5 < away_m < asked["distance_m"] + 1.0:
        yield f"it swung out {away_m:.1f} m away"
    if row["end_tick"] is None:
        return
    beside_m = view.beside_way_m()
    if beside_m.min() > IN_LANE_M:
        yield f"it came only within {beside_m.min():.1f} m of the ego's way"
    if beside_m[0] < OTHER_LANE_M or beside_m[-1] < OTHER_LANE_M:
        yield f"it began {beside_m[0]:.1f} m beside the ego's way, and ended {beside_m[-1]:.1f} m"
    lead_m = view.lead_m(row["actors"][1])
    if lead_m[0] > 0.0 or lead_m[-1] < 0.0:
        yield "it did not pass the other car"
    beside_m_s = float(view.speeds[np.abs(lead_m[1:]).argmin()])
    if abs(beside_m_s - asked["speed_m_s"]) > 1.0:
        yield f"it passed at {beside_m_s:.1f} m/s"


def _coming_from_behind(
    view: View, asked: Mapping[str, Any], row: Mapping[str, Any]
) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    away_m = float(np.hypot(ahead_m, right_m))
    if ahead_m > 0.0 or not asked["distance_m"] < away_m < asked["distance_m"] + 8.0:
        yield f"it appeared {away_m:.1f} m away, {-ahead_m:.1f} m behind"
    dark = [one.tick for one in view.frames if view.lights(one) & FLASHING != FLASHING]
    if dark:
        yield f"its lamps were off in ticks {dark[0]} to {dark[-1]}"
    seen = np.array([view.seen_m(tick) for tick in range(len(view.places))])
    if row["end_tick"] is None:
        return
    if asked["manner"] == "follow":
        gap_m = -seen[-1, 0]
        if not 0.5 * asked["gap_m"] + 2.0 < gap_m < 2.0 * asked["gap_m"] + 8.0:
            yield f"it followed {gap_m:.1f} m behind"
        return
    if seen[-1, 0] < 3.0:
        yield f"it ended {seen[-1, 0]:.1f} m ahead"
    beside = int(np.abs(seen[:, 0]).argmin())
    if abs(seen[beside, 1]) < OTHER_LANE_M:
        yield f"it passed {seen[beside, 1]:.1f} m to the right"
    faster_m_s = float(view.speeds[beside - 1] - view.ego_speeds[beside - 1])
    if abs(faster_m_s - asked["faster_m_s"]) > 1.5:
        yield f"it passed {faster_m_s:.1f} m/s faster"


def _riding_towards(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    away_m = float(np.hypot(*view.seen_m(0)[:2]))
    if not asked["trigger_m"] - 4.0 <= away_m <= asked["trigger_m"] + 1.0:
        yield f"it began {away_m:.1f} m away"
    seen = np.array([view.seen_m(tick) for tick in range(len(view.places))])
    nearest = int(np.abs(seen[:, 0]).argmin())
    if not 0.5 < seen[nearest, 1] < AHEAD_M:
        yield f"it rode {seen[nearest, 1]:.1f} m to the right of the ego"
    if len(seen) > 1 and view.seen_m(-1, by=0)[0] >= seen[0, 0]:
        yield "it did not ride towards the ego"
    speed_m_s = float(np.median(view.speeds)) if len(view.speeds) else asked["speed_m_s"]
    if abs(speed_m_s - asked["speed_m_s"]) > 0.1 * asked["speed_m_s"]:
        yield f"it rode at {speed_m_s:.2f} m/s"
    if row["end_tick"] is not None and seen[-1, 0] > 0.0:
        yield "it did not get past the ego"


def _running_red(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    # It begins as the car enters the junction; what is asked for is where the ego was before.
    away_m = float(np.hypot(*view.seen_m(0)[:2]))
    if away_m > asked["trigger_m"] + JUNCTION_M:
        yield f"it entered the junction {away_m:.1f} m away"
    moved = view.places[-1, :2] - view.places[0, :2]
    turned_deg = np.degrees(np.arctan2(moved[1], moved[0])) - view.came_deg
    turned_deg = abs((turned_deg + 180.0) % 360.0 - 180.0)
    if row["end_tick"] is not None and not CROSS_DEG[0] < turned_deg < CROSS_DEG[1]:
        yield f"it crossed at {turned_deg:.0f} degrees"
    speed_m_s = float(np.median(view.speeds)) if len(view.speeds) else asked["speed_m_s"]
    if abs(speed_m_s - asked["speed_m_s"]) > 0.1 * asked["speed_m_s"]:
        yield f"it drove at {speed_m_s:.1f} m/s"
    if any(one.meta["ego"]["traffic_light_state"] == "Red" for one in view.frames):
        yield "the ego had red"
    shown = set(view.signals_near(0, JUNCTION_M))
    if not {"Red", "Green"} <= shown:
        yield f"the lights of the junction showed {', '.join(sorted(shown)) or 'nothing'}"


def _passing_works(view: View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    away_m = float(np.hypot(*view.seen_m(0)[:2]))
    if not asked["trigger_m"] - 3.0 < away_m <= asked["trigger_m"] + 1.0:
        yield f"it began {away_m:.1f} m from the barrier"
    if view.speeds.max(initial=0.0) > 0.05:
        yield "the barrier moved"
    if row["collision"]:
        yield "the ego touched the works"
    if row["end_tick"] is None:
        return
    seen = np.array([view.seen_m(tick) for tick in range(len(view.places))])
    beside = int(np.abs(seen[:, 0]).argmin())
    if asked["extent"] == "close" and abs(seen[beside, 1]) < CLOSED_M:
        yield f"it passed {seen[beside, 1]:.1f} m beside a closed lane's barrier"
    passed_m_s = float(view.ego_speeds[min(beside, len(view.ego_speeds) - 1)])
    if passed_m_s > asked["speed_m_s"] + FASTER_M_S:
        yield f"the ego passed at {passed_m_s:.1f} m/s"
    if seen[-1, 0] > -asked["length_m"]:
        yield "it ended before the ego was past"


_Rule = Callable[[View, Mapping[str, Any], Mapping[str, Any]], Iterator[str]]
RULES: dict[str, _Rule] = {
    "pedestrian_crosses": _crossing,
    "hard_braking_leader": _leading,
    "cut_in": _cutting_in,
    "stopped_vehicle": _standing,
    "oncoming_overtaker": _overtaking,
    "emergency_vehicle": _coming_from_behind,
    "wrong_way_cyclist": _riding_towards,
    "red_light_runner": _running_red,
    "works_zone": _passing_works,
}
