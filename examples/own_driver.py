"""A driver of one's own: the ego follows its lane in gentle waves, without the Traffic Manager.

``carstage run examples/own_driver.yaml --out DATASET`` drives with it.
"""

import math

import carla

from carstage.collector.drivers import Driver


class Waves(Driver):
    """Swings from side to side of its lane.

    Args:
        speed_m_s: how fast it drives.
        swing_m: how far it leaves the middle of the lane.
        period_s: how long a wave takes.
    """

    def __init__(self, speed_m_s: float = 6.0, swing_m: float = 0.4, period_s: float = 4.0) -> None:
        self.speed_m_s = speed_m_s
        self.swing_m = swing_m
        self.period_s = period_s

    def drive(self, observation):
        """Steer towards a place six metres ahead; hold the speed."""
        here = observation.transform
        ahead = observation.map.get_waypoint(here.location).next(6.0)[0].transform
        phase = 2.0 * math.pi * observation.tick * observation.step_s / self.period_s
        target = ahead.location + self.swing_m * math.sin(phase) * ahead.get_right_vector()
        to_target, right = target - here.location, here.get_right_vector()
        aside_m = to_target.x * right.x + to_target.y * right.y
        missing_m_s = self.speed_m_s - observation.velocity.length()
        return carla.VehicleControl(
            throttle=min(max(0.3 * missing_m_s, 0.0), 0.8),
            brake=min(max(-0.3 * missing_m_s, 0.0), 1.0),
            steer=min(max(0.15 * aside_m, -1.0), 1.0),
        )
