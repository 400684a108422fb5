"""Traffic light sites: where the lights of a planned network stand and what triggers them."""

from __future__ import annotations

import math

from carstage_sim.maps.layout import STOP_LINE_M
from carstage_sim.maps.network import Light, RoadNetwork
from carstage_sim.maps.town import OrientedBox, TrafficLightSite

KERB_HEIGHT_M = 0.15
HEAD_HEIGHT_M = 5.4
TRIGGER_LENGTH_M = 9.0
"""Long enough for a vehicle at 50 km/h and 10 Hz to be seen inside and to stop past its far end
before the junction; the client's Traffic Manager brakes while its vehicle is inside."""
_TRIGGER_HALF_HEIGHT_M = 1.5


def light_sites(network: RoadNetwork) -> tuple[TrafficLightSite, ...]:
    """All lights, by junction and phase."""
    return tuple(
        _site(junction.junction_id, light)
        for junction in network.junctions
        for light in junction.lights
    )


def _site(junction_id: int, light: Light) -> TrafficLightSite:
    # CARLA's light actors stand across the road: their x axis runs along the stop line, and the
    # lenses look along -y. Client code that walks over a trigger volume's x extent relies on it.
    facing_deg = -math.degrees(light.pole.heading_rad)
    rotation_deg = (0.0, _wrapped_deg(facing_deg + 90.0), 0.0)
    boxes = []
    for index in range(1, light.arm.lanes + 1):
        middle = light.arm.mouth.moved(
            -(STOP_LINE_M + TRIGGER_LENGTH_M / 2), -(index - 0.5) * light.arm.lane_width_m
        )
        boxes.append(
            OrientedBox(
                center=(middle.x, -middle.y, _TRIGGER_HALF_HEIGHT_M),
                extent=(light.arm.lane_width_m / 2, TRIGGER_LENGTH_M / 2, _TRIGGER_HALF_HEIGHT_M),
                rotation_deg=rotation_deg,
            )
        )
    return TrafficLightSite(
        sign_id=light.signal_id,
        location=(light.pole.x, -light.pole.y, KERB_HEIGHT_M),
        rotation_deg=rotation_deg,
        # The pole stands right of the traffic that looks at it, so its lanes lie towards +x.
        head=(light.reach_m, 0.0, HEAD_HEIGHT_M, -90.0),
        junction_id=junction_id,
        phase=light.phase,
        trigger=tuple(boxes),
    )


def _wrapped_deg(angle: float) -> float:
    return (angle + 180.0) % 360.0 - 180.0
