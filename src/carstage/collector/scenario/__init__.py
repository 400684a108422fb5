"""What the road users do: one module per kind of scenario.

Those of kinds that few episodes have, such as ``replay``, are imported when one is made.

``base`` holds the seam, ``traffic`` the Traffic Manager's settings, ``routing`` the way by road.
"""

from carstage.collector.scenario import autopilot
from carstage.collector.scenario.base import Population, Scenario, make_scenario, scenario

__all__ = [
    "Population",
    "Scenario",
    "autopilot",
    "make_scenario",
    "scenario",
]
