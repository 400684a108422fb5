"""The table of boxes that a program of the comparison writes; for writers and readers."""

from __future__ import annotations

BOXES_FILE = "boxes.csv"
COLUMNS = (
    "k", "sensor_id", "track_id", "x0", "y0", "x1", "y1", "whole", "n_visible", "occluded",
    "distance", "x", "y", "z", "length", "width", "height", "yaw_deg",
)  # fmt: skip
"""``whole``: all eight corners are in the picture."""
