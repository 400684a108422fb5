"""Names for the columns of arrays whose meaning no axis says.

Coordinates need none: x, y, z are columns 0, 1, 2 everywhere, and so are red, green, blue.
Compiled loops take the numbers (``_YAW = int(Rotation.YAW)``): older numba knows no enums there.
"""

from __future__ import annotations

from enum import IntEnum


class Rotation(IntEnum):
    """Columns of every ``rotation_deg``."""

    PITCH = 0
    YAW = 1
    ROLL = 2


class Control(IntEnum):
    """Columns of a vehicle's control; the first three are what a frame remembers."""

    THROTTLE = 0
    STEER = 1
    BRAKE = 2
    HAND_BRAKE = 3
    REVERSE = 4
    MANUAL = 5
    GEAR = 6


class Touch(IntEnum):
    """Columns of what two boxes share: direction and depth of the overlap, a point of it."""

    NORMAL_X = 0
    NORMAL_Y = 1
    DEPTH = 2
    POINT_X = 3
    POINT_Y = 4
