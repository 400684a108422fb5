"""What makes records of sensors' data: ``base`` holds the seam, ``rig`` spawns and listens.

The table of kinds names the class of each kind.
"""

from carstage.collector.sensors.base import Sensor, sensor_of

__all__ = ["Sensor", "sensor_of"]
