"""Sensors: from one frozen ``WorldState`` and the scene to the bytes that CARLA streams.

Sensors that share a pose and intrinsics share one cast.
"""
