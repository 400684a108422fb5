"""Sensors: from one frozen ``WorldState`` and the scene to the bytes that CARLA streams.

Sensors that share a pose and intrinsics share one cast.
"""

from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.sensors.plugins import register_sensor
from carstage_sim.sensors.world_sensors import WorldSensors

__all__ = ["SensorAttributeError", "WorldSensors", "register_sensor"]
