"""Do detectors that were trained on photographs find what is in the simulator's pictures?

A dataset is recorded: places in three towns and four weathers, each seen by three cars and two
people who stand there. Its labels say what stands where. Two detectors of different families look
at the pictures.
"""

from benchmarks.simulator.detectors.check import check_detectors
from benchmarks.simulator.detectors.packages import load_detectors
from benchmarks.simulator.detectors.scenes import record_scenes

__all__ = ["check_detectors", "load_detectors", "record_scenes"]
