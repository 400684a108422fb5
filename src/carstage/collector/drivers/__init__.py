"""Who drives the ego when the Traffic Manager does not.

``base`` holds the seam that a class of yours fills, ``loading`` finds it, ``driving`` asks it ahead
of each step. ``route``, ``replay`` and ``devices`` are Car-STAGE's own drivers.
"""

from carstage.collector.drivers.base import Driver, Observation

__all__ = ["Driver", "Observation"]
