"""Scenario ``storyboard``: an OpenSCENARIO file that Car-STAGE plays itself.

``playing`` is the scenario, ``parts`` starts and ends what the file describes, ``conditions`` judge
by ``road_users``, ``movers`` carry actions out, ``places`` finds positions on the map.
"""

from carstage.collector.scenario.storyboard.playing import Storyboard

__all__ = ["Storyboard"]
