"""Does traffic flow? The client's Traffic Manager drives; everything is recorded, then judged.

``recorder`` fills a ``recording`` during a ``trial``; ``standing``, ``passages`` and ``collisions``
read it, ``judging`` sets the figures beside their targets, ``campaign`` goes from town to town.
"""

from benchmarks.simulator.traffic.campaign import check_traffic, drive, judge_saved
from benchmarks.simulator.traffic.judging import judge
from benchmarks.simulator.traffic.recording import Recording

__all__ = ["Recording", "check_traffic", "drive", "judge", "judge_saved"]
