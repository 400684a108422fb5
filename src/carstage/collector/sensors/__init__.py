"""One class per kind of sensor; importing this package fills the registry.

``base`` holds the seam and the registry, ``rig`` spawns and listens, the rest are the kinds.
"""

from carstage.collector.sensors import cameras, inertial, rays
from carstage.collector.sensors.base import SENSOR_KINDS, Sensor, register

__all__ = ["SENSOR_KINDS", "Sensor", "cameras", "inertial", "rays", "register"]
