"""Boxes and outlines that touch: who runs into whom, and what the collision does to the bodies."""
