"""Do pictures have structure everywhere but in the sky, by day and by night?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.scene import ReferenceScene, named_presets, populate, town_of
from carstage.bench.verdict import Figure
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import ImageFrame

MOST_FLAT = 0.015
"""Largest share of a picture, its sky aside, that may lie in flat patches."""

_PATCH = 32
_FLAT_CODES = 1.0
_SKY_TAG = 11
_TOWNS = ("Stage01", "Stage02", "Stage03")
_WEATHERS = {"day": ("ClearNoon", "WetNoon"), "night": ("ClearNight", "WetNight")}
_NOISY = "night_with_sensor_noise"
_PLACES = 4
_VEHICLES, _WALKERS, _SEED = 40, 15, 7
_EYE_M = 1.7


def flat_figures() -> list[Figure]:
    """How many pictures of three towns have too much without structure, and the worst of them.

    Those by night are judged with the sensor's noise, too: it dithers what is as dark as few codes.
    """
    shares: dict[str, dict[str, float]] = {time: {} for time in (*_WEATHERS, _NOISY)}
    for town in _TOWNS:
        map_ = town_of(town)
        with WorldSensors(map_, threads=1) as sensors:
            scene = populate(map_, sensors, vehicles=_VEHICLES, walkers=_WALKERS, seed=_SEED)
            ways = np.linspace(0, len(map_.spawn_points) - 1, _PLACES).astype(int)
            for time, weathers in _WEATHERS.items():
                for weather in weathers:
                    for k, way in enumerate(ways.tolist()):
                        x, y, z, _, yaw, _ = map_.spawn_points[way].tolist()
                        place = (x, y, z + _EYE_M)
                        here = replace(scene, location=place, rotation_deg=(-4.0, yaw, 0.0))
                        name = f"{town} {weather} {k}"
                        shares[time][name] = flat_share(here, weather)
                        if time == "night":
                            shares[_NOISY][name] = flat_share(here, weather, noise=True)
    figures = []
    for time, found in shares.items():
        over = sum(share > MOST_FLAT for share in found.values())
        worst = max(found, key=lambda name: found[name])
        figures += [
            Figure(f"pictures_by_{time}", len(found)),
            Figure(f"pictures_by_{time}_too_flat", over, "<=", 0),
            Figure(f"flattest_by_{time}", f"{worst}: {found[worst]:.4f}"),
        ]
    return figures


def flat_share(scene: ReferenceScene, weather: str, *, noise: bool = False) -> float:
    """Share of the pixels outside the sky that lie in patches of 32 x 32 without any structure.

    Flat is a patch whose brightness has a standard deviation below one code.

    Args:
        scene: the world and the place to look from.
        weather: a named preset.
        noise: whether the camera has ``sensor_noise``.
    """
    state = scene.state(named_presets()[weather])
    size = {"image_size_x": 640, "image_size_y": 352}
    colour = scene.frame(state, "camera.rgb", sensor_noise=str(noise).lower(), **size)
    tags = scene.frame(state, "camera.semantic_segmentation", **size)
    assert isinstance(colour, ImageFrame)
    assert isinstance(tags, ImageFrame)
    grey = colour.pixels[..., :3].astype(np.float64) @ np.array([0.114, 0.587, 0.299])
    seen = tags.pixels[..., 2] != _SKY_TAG
    return share_of_flat(grey, seen)


def share_of_flat(grey: NDArray[np.float64], seen: NDArray[np.bool_]) -> float:
    """Share of the pixels that count which lie in flat patches of them.

    Args:
        grey: ``(H, W)`` brightness in codes.
        seen: ``(H, W)``, which pixels count. A patch counts if all of its pixels do.
    """
    rows, columns = grey.shape[0] // _PATCH, grey.shape[1] // _PATCH
    patches = grey.reshape(rows, _PATCH, columns, _PATCH).swapaxes(1, 2).reshape(-1, _PATCH**2)
    whole = seen.reshape(rows, _PATCH, columns, _PATCH).swapaxes(1, 2).reshape(-1, _PATCH**2)
    flat = (patches.std(axis=1) < _FLAT_CODES) & whole.all(axis=1)
    return float(flat.sum() * _PATCH**2 / max(int(seen.sum()), 1))
