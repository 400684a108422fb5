"""How strong sun and sky are under clouds, by the IES.

IES, Recommended practice for the calculation of daylight availability, Journal of the Illuminating
Engineering Society 13 (1984): mean illuminances of three classes of sky over the sun's altitude. A
clear sky is not taken from there, but from the air that scatters it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

ABOVE_AIR_KLX = 127.5
"""Illuminance of a surface that faces the sun above the air."""
_EXTINCTION = 0.80
"""Of a partly cloudy sky, for each mass of air; one is overhead, more by one over the sine."""
_TWILIGHT_KLX, _PARTLY_KLX, _OVERCAST_KLX = 0.3, 45.0, 21.0
"""The sky's light on the ground: at sunrise, and what a sun in the zenith adds, for two classes."""
_CLEAR, _PARTLY, _OVERCAST = 0.15, 0.55, 0.9
"""Middles of the classes of cloudiness: up to 3, 4 to 7, and 8 to 10 tenths."""
_LOWEST_RAD = math.radians(4.0)
"""Below this altitude of the sun the sky becomes what it is by night."""

CLEAR_UP_TO = _CLEAR
"""Cloudiness, 0-1, up to which a sky is a clear one."""


def luminance(colour: NDArray[np.float64]) -> float:
    """Luminance of linear sRGB."""
    red, green, blue = colour.tolist()
    return float(0.2126 * red + 0.7152 * green + 0.0722 * blue)


def shares(cloudiness: float) -> tuple[float, float, float]:
    """How much of each class a sky is: clear, partly cloudy, overcast; the sum is 1."""
    clear, partly, overcast = (
        float(np.interp(cloudiness, (_CLEAR, _PARTLY, _OVERCAST), peak)) for peak in np.eye(3)
    )
    return clear, partly, overcast


def sun_left(cloudiness: float, altitude_rad: float, clear_klx: float) -> float:
    """Share of a clear sky's sunlight that is left under clouds, as a mean over their gaps.

    Args:
        cloudiness: 0-1.
        altitude_rad: of the sun.
        clear_klx: what the sun gives a surface that faces it without clouds; above 0.
    """
    clear, partly, _ = shares(cloudiness)
    masses = 1.0 / max(math.sin(altitude_rad), 1e-3)
    return clear + partly * ABOVE_AIR_KLX * math.exp(-_EXTINCTION * masses) / clear_klx


def sky_gain(cloudiness: float, altitude_rad: float, own_klx: float) -> float:
    """Factor that gives a sky under clouds the source's illuminance.

    Args:
        cloudiness: 0-1.
        altitude_rad: of the sun.
        own_klx: illuminance of the ground by the sky as it is; above 0.
    """
    clear, partly, overcast = shares(cloudiness)
    high = max(math.sin(altitude_rad), 0.0)
    klx = partly * (_TWILIGHT_KLX + _PARTLY_KLX * high)
    klx += overcast * (_TWILIGHT_KLX + _OVERCAST_KLX * high)
    day = min(max(altitude_rad / _LOWEST_RAD, 0.0), 1.0)
    return 1.0 + day * (clear + klx / own_klx - 1.0)
