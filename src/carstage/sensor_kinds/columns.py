"""Names for the columns of sensor data whose meaning no axis says.

Coordinates need none: x, y, z are columns 0, 1, 2 everywhere, and so are red, green, blue.
"""

from __future__ import annotations

from enum import IntEnum


class Bgra(IntEnum):
    """Channels of a raw picture's pixels, as the client hands them out."""

    BLUE = 0
    GREEN = 1
    RED = 2
    ALPHA = 3


class Instance(IntEnum):
    """Channels of a decoded instance picture."""

    ID = 0
    TAG = 1


class Point(IntEnum):
    """Columns of a LiDAR's points after x, y, z."""

    INTENSITY = 3


class TaggedPoint(IntEnum):
    """Columns of the points of a semantic flash LiDAR after those of :class:`Point`.

    ``OBJECT`` is the id of what was hit, ``TAG`` its semantic tag in CARLA's numbers since 0.9.14.
    Both are 0 of a false echo.
    """

    OBJECT = 4
    TAG = 5


class SweepPoint(IntEnum):
    """Columns of the points of a sweeping LiDAR after x, y, z.

    ``TIME`` is in seconds, that of the frame being 0. The last three are x, y, z as measured, in
    the sensor's axes at that time.
    """

    INTENSITY = 3
    TIME = 4
    RING = 5
    X_MEASURED = 6
    Y_MEASURED = 7
    Z_MEASURED = 8


class Message(IntEnum):
    """Columns of a received V2X message."""

    STATION_ID = 0
    STATION_TYPE = 1
    GENERATION_DELTA_TIME = 2
    LATITUDE = 3
    LONGITUDE = 4
    HEADING = 5
    SPEED = 6
    DRIVE_DIRECTION = 7
    LENGTH = 8
    WIDTH = 9
    ACCELERATION_X = 10
    ACCELERATION_Y = 11
    ACCELERATION_Z = 12
    YAW_RATE = 13
    POWER = 14


class Detection(IntEnum):
    """Columns of a radar's raw detections."""

    RANGE_RATE = 0
    AZIMUTH = 1
    ALTITUDE = 2
    DEPTH = 3


class RcsDetection(IntEnum):
    """Columns of the detections of a radar with cross sections, after those of :class:`Detection`.

    ``RCS`` is in dBsm, ``TAG`` a semantic tag in CARLA's numbers since 0.9.14.
    """

    RCS = 4
    TAG = 5
