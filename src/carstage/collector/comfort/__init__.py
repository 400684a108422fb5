"""Vehicles of the Traffic Manager that drive as people like to be driven.

The Traffic Manager steers, changes lanes and stops in emergencies. Ahead of each step it is told
a desired speed, by which it accelerates and brakes gently.
"""

from carstage.collector.comfort.driving import ComfortableDriving, Streets
from carstage.collector.comfort.fleet import comfortable
from carstage.collector.comfort.road import StopLines
from carstage.collector.comfort.road_users import RoadUsers

__all__ = ["ComfortableDriving", "RoadUsers", "StopLines", "Streets", "comfortable"]
