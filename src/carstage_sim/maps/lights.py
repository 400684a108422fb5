"""Traffic light sites: where the lights of a map stand, what triggers them, when they are green.

As in CARLA, the lights of one junction form a group, the signals of one OpenDRIVE controller are
green together, and the controllers take turns (``TrafficLightManager.cpp``). Lights that no
controller names take turns by approach, after the ones that have a controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from carstage_sim.content.street_furniture import MAST_RADIUS_M
from carstage_sim.maps.signals import (
    LIGHT,
    TRIGGER_LENGTH_M,
    Controller,
    GovernedLane,
    Signal,
    SignalPlan,
)
from carstage_sim.maps.town import OrientedBox, TrafficLightSite

HEAD_HEIGHT_M = 5.4
_TRIGGER_HALF_HEIGHT_M = 1.5
_LONGEST_ARM_M = 9.0
_SAME_PLACE_M = 0.5
_SAME_APPROACH_DEG = 30.0
_FIRST_LONE_GROUP = -2

_UNDER_MAST_M = (
    (0.0, 0.0), (MAST_RADIUS_M, 0.0), (0.0, MAST_RADIUS_M), (-MAST_RADIUS_M, 0.0),
    (0.0, -MAST_RADIUS_M),
)  # fmt: skip
"""Where the ground under a mast is looked at: it may stand on the edge of a kerb."""

HeightAt = Callable[[float, float], float]


def light_sites(plan: SignalPlan, height_at: HeightAt) -> tuple[TrafficLightSite, ...]:
    """All lights, by junction and phase.

    Args:
        plan: what the map says.
        height_at: height of the ground (m) at x, y, for the feet of the masts.
    """
    lights = {signal.signal_id: signal for signal in plan.of_kind(LIGHT)}
    placed = _phases(lights, plan.controllers)
    order = sorted(placed, key=lambda signal_id: (*placed[signal_id], signal_id))
    return tuple(_site(lights[key], *placed[key], height_at) for key in order)


def _phases(
    lights: dict[str, Signal], controllers: Sequence[Controller]
) -> dict[str, tuple[int, int]]:
    """Junction and phase of every light."""
    placed: dict[str, tuple[int, int]] = {}
    used: dict[int, int] = {}
    own = _own_controllers(controllers)
    for number, controller in enumerate(controllers):
        members = [s for s in dict.fromkeys(controller.signals) if s in lights and own[s] == number]
        if not members:
            continue
        phase = used.get(controller.junction_id, 0)
        used[controller.junction_id] = phase + 1
        for signal_id in members:
            placed[signal_id] = (controller.junction_id, phase)
    approaches: dict[int, list[tuple[float, int]]] = {}
    lone = _FIRST_LONE_GROUP
    for signal_id, light in sorted(lights.items()):
        if signal_id in placed:
            continue
        junction_id = next((x.junction_id for x in light.lanes if x.junction_id != -1), -1)
        if junction_id == -1:
            placed[signal_id] = (lone, 0)
            lone -= 1
            continue
        yaw = light.lanes[0].yaw_deg
        known = approaches.setdefault(junction_id, [])
        phase = next((p for a, p in known if abs(_wrapped(a - yaw)) < _SAME_APPROACH_DEG), -1)
        if phase == -1:
            phase = used.get(junction_id, 0)
            used[junction_id] = phase + 1
            known.append((yaw, phase))
        placed[signal_id] = (junction_id, phase)
    return placed


def _own_controllers(controllers: Sequence[Controller]) -> dict[str, int]:
    """The controller of each signal, by its place in the list.

    A file may name a signal under several controllers (junction 532 of CARLA's Town10HD does); the
    one with the fewest signals counts, so that the signal shares its green with as few as can be.
    """
    own: dict[str, int] = {}
    others = [len(set(controller.signals)) for controller in controllers]
    for number, controller in enumerate(controllers):
        for signal_id in controller.signals:
            if signal_id not in own or others[number] < others[own[signal_id]]:
                own[signal_id] = number
    return own


def _site(light: Signal, junction_id: int, phase: int, height_at: HeightAt) -> TrafficLightSite:
    x, y, _ = light.location
    # CARLA turns its light actors by a quarter against the signal: their x axis runs along the stop
    # line. Client code that walks over a trigger volume's x extent relies on it.
    yaw_deg = _wrapped(light.yaw_deg + 90.0)
    reach_m, looks_deg = 0.0, 90.0
    if light.lanes:
        looks_deg = _wrapped(_mean_deg(light.lanes) + 180.0 - yaw_deg)
        middle_x = sum(lane.stop[0] for lane in light.lanes) / len(light.lanes)
        middle_y = sum(lane.stop[1] for lane in light.lanes) / len(light.lanes)
        angle = math.radians(yaw_deg)
        reach_m = (middle_x - x) * math.cos(angle) + (middle_y - y) * math.sin(angle)
        reach_m = min(max(reach_m, -_LONGEST_ARM_M), _LONGEST_ARM_M)
    return TrafficLightSite(
        sign_id=light.signal_id,
        location=(x, y, max(height_at(x + dx, y + dy) for dx, dy in _UNDER_MAST_M)),
        rotation_deg=(0.0, yaw_deg, 0.0),
        head=(reach_m, 0.0, HEAD_HEIGHT_M, looks_deg),
        junction_id=junction_id,
        phase=phase,
        trigger=tuple(trigger_boxes(light.lanes)),
    )


def trigger_boxes(lanes: Iterable[GovernedLane]) -> list[OrientedBox]:
    """A volume before each stop, half as wide as the lane; ways on from one lane share theirs."""
    boxes: list[OrientedBox] = []
    for lane in lanes:
        if any(math.dist(box.center[:2], lane.before[:2]) < _SAME_PLACE_M for box in boxes):
            continue
        x, y, z = lane.before
        boxes.append(
            OrientedBox(
                center=(x, y, z + _TRIGGER_HALF_HEIGHT_M),
                extent=(lane.width_m / 4, TRIGGER_LENGTH_M / 2, _TRIGGER_HALF_HEIGHT_M),
                rotation_deg=(0.0, _wrapped(lane.before_yaw_deg + 90.0), 0.0),
            )
        )
    return boxes


def _mean_deg(lanes: tuple[GovernedLane, ...]) -> float:
    """Mean direction of travel."""
    angles = [math.radians(lane.yaw_deg) for lane in lanes]
    return math.degrees(math.atan2(sum(map(math.sin, angles)), sum(map(math.cos, angles))))


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
