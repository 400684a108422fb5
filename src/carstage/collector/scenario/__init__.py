"""What the road users do: one module per kind of scenario; importing this fills the registry.

``base`` holds the seam, ``traffic`` the Traffic Manager's settings, ``routing`` the way by road.
"""

from carstage.collector.scenario import autopilot, program, replay, storyboard
from carstage.collector.scenario.base import Population, Scenario, make_scenario, scenario

__all__ = [
    "Population",
    "Scenario",
    "autopilot",
    "make_scenario",
    "program",
    "replay",
    "scenario",
    "storyboard",
]
