"""The built-in towns: from above, and the sheets of the page about rendering."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from PIL import Image

from benchmarks.simulator.render.gallery import gallery_sheets
from benchmarks.simulator.render.scene import named_presets, populate, rgb, town_of
from benchmarks.simulator.traffic.towns import STAGES
from carstage_sim.render.quality import Quality
from carstage_sim.sensors import WorldSensors

_SIZE_PX = (840, 700)
_SAMPLES = 2
"""Rays along each side of a pixel."""
_ABOVE_M = 750.0
"""High, so that houses do not lean, and within the 1000 m that cameras see."""
_MARGIN_M = 40.0
_VEHICLES = 60
_SEED = 3
_SUN_ALTITUDE_DEG, _SUN_AZIMUTH_DEG = 55.0, 150.0


def rendering() -> Iterator[tuple[str, Image.Image]]:
    """The sheets of the page about rendering, as ``python -m benchmarks render`` paints them."""
    for name, sheet in gallery_sheets(town="Stage02", seed=_SEED):
        yield f"rendering/{name}", sheet


def towns_from_above() -> Iterator[tuple[str, Image.Image]]:
    """File name and picture of each built-in town."""
    for name in STAGES:
        yield f"{name.lower()}.jpg", town_from_above(name, _SIZE_PX)


def town_from_above(name: str, size: tuple[int, int]) -> Image.Image:
    """A town with traffic on a day without haze, x to the right and y down.

    Args:
        name: of the map.
        size: width and height (px).
    """
    width, height = size
    town = town_of(name)
    lowest, highest = town.spawn_points[:, :2].min(axis=0), town.spawn_points[:, :2].max(axis=0)
    (x, y), (along, across) = (lowest + highest) / 2.0, (highest - lowest) / 2.0 + _MARGIN_M
    half_m = max(along, across * width / height)
    day = replace(
        named_presets()["ClearNoon"], fog_density=0.0,
        sun_altitude_angle=_SUN_ALTITUDE_DEG, sun_azimuth_angle=_SUN_AZIMUTH_DEG,
    )  # fmt: skip
    with WorldSensors(town, quality=Quality.EPIC) as sensors:
        scene = populate(town, sensors, vehicles=_VEHICLES, walkers=0, seed=_SEED)
        scene.location, scene.rotation_deg = (float(x), float(y), _ABOVE_M), (-90.0, -90.0, 0.0)
        frame = scene.frame(
            scene.state(day),
            "camera.rgb",
            image_size_x=_SAMPLES * width,
            image_size_y=_SAMPLES * height,
            fov=2.0 * math.degrees(math.atan(half_m / _ABOVE_M)),
        )
    return Image.fromarray(rgb(frame)).resize(size, Image.Resampling.BOX)
