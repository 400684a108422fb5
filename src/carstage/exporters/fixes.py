"""What a satellite receiver reads, in degrees that every program understands."""

from __future__ import annotations

from carstage.dataset.saved_frames import Frame
from carstage.geometry import GeoPoint


def satellite_fix(frame: Frame, sensor_id: str) -> GeoPoint:
    """A GNSS sensor's reading with north at -y, as ``ego.parquet`` has places.

    Servers have formulas of their own, and some mirror north: the dataset keeps what was read.

    Raises:
        DatasetError: the sensor has no reading of the frame.
    """
    globe = frame.episode.geo_frame
    reading = GeoPoint(*(float(value) for value in frame.read(sensor_id)))
    return globe.place(globe.gnss_location(reading))
