"""Bounds of what the simulator can compute of a sensor; ``--describe`` publishes them."""

from __future__ import annotations

import math
from collections.abc import Mapping

from carstage_sim.sensors.attributes import number, require, within

Bounds = tuple[float, float]
"""The lowest and the highest value; infinite where there is no bound."""

MOST_PIXELS = 7680 * 4320
"""Of a picture: 8K UHD."""

_CAMERA = "sensor.camera."
_LIDAR = "sensor.lidar."
_FROM_ZERO = (0.0, math.inf)
_EXPOSURE: Mapping[str, Bounds] = {"exposure_compensation": (-30.0, 30.0)}
_BOUNDS: Mapping[str, Mapping[str, Bounds]] = {
    _CAMERA: {
        "image_size_x": (1, 8192),
        "image_size_y": (1, 8192),
        "lens_circle_multiplier": _FROM_ZERO,
        "lens_circle_falloff": _FROM_ZERO,
    },
    "sensor.camera.rgb": _EXPOSURE,
    "sensor.camera.dvs": _EXPOSURE,
    _LIDAR: {
        "channels": (1, 1024),
        "points_per_second": (0, 20_000_000),
        "rotation_frequency": (0, 1000.0),
        "upper_fov": (-90, 90),
        "lower_fov": (-90, 90),
    },
    "sensor.other.occupancy": {
        **dict.fromkeys(("ahead", "behind", "left", "right", "up", "down"), (0.0, 500.0)),
        "resolution": (0.05, 10.0),
    },
    "sensor.other.radar": {"points_per_second": (0, 20_000_000)},
}


def bounds_of(type_id: str) -> dict[str, Bounds]:
    """The bounds of a sensor's attributes, for those that have any."""
    return {
        name: bounds
        for prefix, found in _BOUNDS.items()
        if type_id.startswith(prefix)
        for name, bounds in found.items()
    }


def most_pixels_of(type_id: str) -> int | None:
    """The most pixels of a camera's picture; None for what is no camera."""
    return MOST_PIXELS if type_id.startswith(_CAMERA) else None


def check_bounds(type_id: str, attributes: Mapping[str, str]) -> None:
    """Refuse values that the simulator cannot compute with.

    Args:
        type_id: the sensor's blueprint.
        attributes: as the client set them; what it did not set has a default that is within.

    Raises:
        SensorAttributeError: a value is no number or outside of its bounds.
    """
    for name, (lowest, highest) in bounds_of(type_id).items():
        within(name, number(attributes, name, max(lowest, 1.0)), lowest, highest)
    most = most_pixels_of(type_id)
    if most is not None:
        width, height = (number(attributes, f"image_size_{axis}", 1.0) for axis in "xy")
        pixels = width * height
        require(
            pixels <= most,
            f"image_size_x times image_size_y is {pixels:.0f}, above {most} (8K UHD)",
        )
