"""Signs that clients see as actors, as CARLA makes them of a file's stop and yield signals.

CARLA makes no actors of speed limits in a file (``TrafficLightManager.cpp``); clients find those as
landmarks.
"""

from __future__ import annotations

from carstage_sim.maps.lights import HeightAt, trigger_boxes
from carstage_sim.maps.signals import STOP, YIELD, SignalPlan
from carstage_sim.maps.town import TrafficSignSite

_TYPES = {STOP: "traffic.stop", YIELD: "traffic.yield"}


def sign_sites(plan: SignalPlan, height_at: HeightAt) -> tuple[TrafficSignSite, ...]:
    """All stop and yield signs, by id.

    Args:
        plan: what the map says.
        height_at: height of the ground (m) at x, y, for the feet of the posts.
    """
    return tuple(
        TrafficSignSite(
            sign_id=sign.signal_id,
            type_id=_TYPES[sign.kind],
            location=(*sign.location[:2], height_at(*sign.location[:2])),
            # A quarter turn against the signal, as for the lights.
            rotation_deg=(0.0, (sign.yaw_deg + 90.0 + 180.0) % 360.0 - 180.0, 0.0),
            trigger=tuple(trigger_boxes(sign.lanes)),
        )
        for sign in plan.signals
        if sign.kind in _TYPES
    )
