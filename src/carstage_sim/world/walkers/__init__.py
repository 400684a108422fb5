"""Pedestrians: how they walk, their gait and their bones."""
