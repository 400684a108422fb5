"""Lights and signs: where they stand and which lanes they govern."""

from __future__ import annotations

import math
from collections.abc import Sequence

from carstage_sim.maps.writer.alignment import (
    Point,
    Pose2,
    pose_at,
    project,
    snapped_heading,
    wrapped,
)
from carstage_sim.maps.writer.arms import Arm
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.network import (
    Controller,
    Crosswalk,
    Road,
    Signal,
    SignalReference,
)
from carstage_sim.maps.writer.plan import Control

CROSSWALK_NEAR_M = 0.8
"""Edge of a crosswalk that faces the junction, before the mouth."""
CROSSWALK_FAR_M = 4.3
"""Edge of a crosswalk that faces the traffic, before the mouth."""
STOP_LINE_M = 5.6
"""Near edge of the stop line, before the mouth."""
POLE_FROM_KERB_M = 0.9
SPEED_SIGN_M = 11.0
"""Speed limit signs stand this far behind a junction."""
_SIGN_FROM_KERB_M = 0.5
_LIGHT_TYPE = "1000001"
_SPEED_LIMIT_TYPE = "274"
_PRIORITY_TYPES = {Control.STOP: ("206", "Stop"), Control.YIELD: ("205", "Yield")}
_SPEED_SIGN_SIZE_M = 0.66
_PRIORITY_SIGN_SIZE_M = 0.9


def add_lights(
    builder: NetworkBuilder,
    junction_id: int,
    center: Point,
    arms: Sequence[Arm],
    paths: list[Road],
) -> list[Controller]:
    """One light for each approach, each in a separate phase.

    No two approaches of a junction are green together, so turning traffic needs no gap. A light
    stands across the junction, right of the lanes that it governs. It governs nothing there; the
    approach refers to it at its stop line.
    """
    controllers = []
    for phase, arm in enumerate(arm for arm in arms if arm.inbound.lanes):
        pole = _pole(arm, center, arms)
        host, s_m, t_m = _host(pole, paths)
        signal_id = str(junction_id * 10 + phase)
        beside = pose_at(host.alignment, s_m).heading_rad
        builder.add_signal(
            host.road_id,
            Signal(
                signal_id,
                f"Light {signal_id}",
                s_m,
                t_m,
                turn_rad=wrapped(pole.heading_rad - beside),
                orientation="none",
                lanes=(0, 0),
                type_code=_LIGHT_TYPE,
                is_light=True,
            ),
        )
        lanes = arm.driving_lanes(inbound=True)
        builder.add_reference(
            arm.road_id,
            SignalReference(
                signal_id,
                arm.station_m(STOP_LINE_M),
                math.copysign(arm.inbound.kerb_m, lanes[0]),
                "+" if lanes[0] < 0 else "-",
                lanes,
            ),
        )
        controllers.append(Controller(str(junction_id * 10 + 5 + phase), phase, signal_id))
    return controllers


def add_priority_sign(builder: NetworkBuilder, arm: Arm, control: Control) -> None:
    """A stop or yield sign at the right-hand kerb of an approach, beside its stop line."""
    code, name = _PRIORITY_TYPES[control]
    lanes = arm.driving_lanes(inbound=True)
    signal_id = builder.next_sign_id()
    builder.add_signal(
        arm.road_id,
        Signal(
            signal_id,
            f"{name} {signal_id}",
            arm.station_m(STOP_LINE_M),
            math.copysign(arm.inbound.kerb_m + _SIGN_FROM_KERB_M, lanes[0]),
            turn_rad=math.pi if lanes[0] < 0 else 0.0,
            orientation="+" if lanes[0] < 0 else "-",
            lanes=lanes,
            type_code=code,
            size_m=_PRIORITY_SIGN_SIZE_M,
        ),
    )


def add_speed_sign(builder: NetworkBuilder, arm: Arm) -> None:
    """The limit, posted for the traffic that leaves a junction into an arm."""
    side_m = arm.outbound.kerb_m + _SIGN_FROM_KERB_M
    station_m = arm.station_m(SPEED_SIGN_M)
    post_limit(
        builder,
        arm.road_id,
        station_m,
        side_m,
        arm.driving_lanes(inbound=False),
        arm.speed_limit_kmh,
    )


def post_limit(
    builder: NetworkBuilder,
    road_id: int,
    s_m: float,
    side_m: float,
    lanes: tuple[int, int],
    limit_kmh: int,
) -> None:
    """A speed limit sign ``side_m`` from the reference line, on the side of the lanes."""
    builder.add_signal(
        road_id,
        Signal(
            builder.next_sign_id(),
            f"Speed limit {limit_kmh}",
            s_m,
            math.copysign(side_m, lanes[0]),
            turn_rad=math.pi if lanes[0] < 0 else 0.0,
            orientation="+" if lanes[0] < 0 else "-",
            lanes=lanes,
            type_code=_SPEED_LIMIT_TYPE,
            subtype=str(limit_kmh),
            value=str(limit_kmh),
            unit="km/h",
            text=str(limit_kmh),
            size_m=_SPEED_SIGN_SIZE_M,
        ),
    )


def add_crosswalk(builder: NetworkBuilder, arm: Arm) -> None:
    """A crosswalk before the mouth of an arm, from kerb to kerb."""
    builder.add_crosswalk(
        arm.road_id,
        Crosswalk(
            f"{arm.road_id}{0 if arm.contact == 'start' else 1}",
            arm.station_m((CROSSWALK_NEAR_M + CROSSWALK_FAR_M) / 2),
            width_m=arm.inbound.kerb_m + arm.outbound.kerb_m,
            length_m=CROSSWALK_FAR_M - CROSSWALK_NEAR_M,
        ),
    )


def _pole(arm: Arm, center: Point, arms: Sequence[Arm]) -> Pose2:
    """The foot of an approach's light; it heads the way that the lenses look."""
    lenses_rad = snapped_heading(arm.mouth.heading_rad + math.pi)
    right_m = arm.inbound.kerb_m + POLE_FROM_KERB_M
    ahead = [a for a in arms if a is not arm and arm.direction_to(a) == "straight"]
    if ahead:
        foot = ahead[0].out.moved(0.0, -(ahead[0].outbound.kerb_m + POLE_FROM_KERB_M))
        return Pose2(foot.x, foot.y, lenses_rad)
    # Across a T: behind the far kerb of the street that runs through.
    through = next(a for a in arms if a is not arm)
    forward, _ = arm.mouth.local(center)
    angle = wrapped(through.mouth.heading_rad - arm.mouth.heading_rad)
    kerb_m = max(through.inbound.kerb_m, through.outbound.kerb_m) + POLE_FROM_KERB_M
    forward += kerb_m / abs(math.sin(angle)) - right_m / math.tan(angle)
    foot = arm.mouth.moved(forward, -right_m)
    return Pose2(foot.x, foot.y, lenses_rad)


def _host(pole: Pose2, paths: list[Road]) -> tuple[Road, float, float]:
    """The path of the junction beside which a pole stands, with its s and t there.

    Straight paths come first: beside a curve the same place has several stations.
    """
    straight = [p for p in paths if len(p.alignment) == 1 and not p.alignment[0].curvature_per_m]
    for candidates in (straight, paths):
        best: tuple[Road, float, float] | None = None
        for road in candidates:
            found = project(road.alignment, pole.point)
            if found and (best is None or abs(found[1]) < abs(best[2]) - 1e-6):
                best = road, *found
        if best is not None:
            return best
    raise ValueError(f"no path beside the pole at {pole.x:.1f}, {pole.y:.1f}")
