"""Do pictures look right? Figures that stand for what an eye would see."""

from __future__ import annotations

import itertools
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.flatness import MOST_FLAT, flat_figures, flat_share
from benchmarks.simulator.render.grounding import ground_figures
from benchmarks.simulator.render.scene import ReferenceScene, named_presets, plain_view
from carstage.bench.verdict import Figure
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.film import Film
from carstage_sim.sensors.view import Camera
from carstage_sim.world.state import Weather

Array = NDArray[np.float64]

_LEAST_APART = 3.0
_SHADOW_DEG = 2.0
_POLE_M = 3.0


def look_figures(scene: ReferenceScene) -> list[Figure]:
    """All figures of this module, in the order of the issue's lines."""
    return [
        *preset_figures(scene),
        Figure("shadow_off_the_sun_deg", shadow_error_deg(), "<=", _SHADOW_DEG),
        Figure("pixels_in_flat_patches", flat_share(scene, "ClearNoon"), "<=", MOST_FLAT),
        *flat_figures(),
        *ground_figures(scene),
    ]


def lab(srgb: NDArray[np.uint8]) -> Array:
    """CIE L*a*b* (D65) of sRGB codes (IEC 61966-2-1, CIE 15)."""
    value = srgb.astype(np.float64) / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    matrix = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    xyz = linear @ matrix.T / np.array([0.9505, 1.0, 1.089])
    root = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    x, y, z = np.moveaxis(root, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def preset_figures(scene: ReferenceScene) -> list[Figure]:
    """How far apart the named weathers are, and how bright noon, sunset and night."""
    pictures = {
        name: lab(scene.picture(weather, 256, 144)) for name, weather in named_presets().items()
    }
    nearest, pair = float("inf"), ""
    for one, other in itertools.combinations(sorted(pictures), 2):
        apart = float(np.linalg.norm(pictures[one] - pictures[other], axis=-1).mean())
        if apart < nearest:
            nearest, pair = apart, f"{one} and {other}"
    figures = [
        Figure("named_presets", len(pictures)),
        Figure("least_difference_of_two_presets_delta_e", nearest, ">=", _LEAST_APART),
        Figure("two_presets_that_differ_least", pair),
    ]
    light = {name: float(picture[..., 0].mean()) for name, picture in pictures.items()}
    ordered = 0
    for kind in ("Clear", "Cloudy", "Wet", "WetCloudy", "HardRain"):
        noon, sunset, night = (light[kind + time] for time in ("Noon", "Sunset", "Night"))
        ordered += noon > sunset > night
        figures.append(
            Figure(f"lightness_of_{kind}_noon_sunset_night", f"{noon:.1f} {sunset:.1f} {night:.1f}")
        )
    return [*figures, Figure("kinds_with_noon_above_sunset_above_night", ordered, "==", 5)]


def shadow_error_deg() -> float:
    """Largest angle between the sun and where a pole's shadow on a plain puts it."""
    side = 384
    places = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    worst = 0.0
    with closing(RayCaster(1)) as caster:
        for azimuth, altitude in ((35.0, 40.0), (140.0, 30.0), (260.0, 55.0)):
            weather = Weather(sun_azimuth_angle=azimuth, sun_altitude_angle=altitude)
            # Straight down from so high that a pixel is a place on the ground.
            camera = Camera(side, side, 2.0, (0.0, 0.0, 400.0), (-90.0, 0.0, 0.0), 0)
            view = plain_view(caster, weather, pole_m=_POLE_M)
            grey = view.colours(camera, Film()).astype(np.float64).mean(axis=-1)
            reach = 400.0 * np.tan(np.radians(1.0))
            rows, columns = np.nonzero(grey < 0.6 * np.median(grey))
            x, y = -places[rows] * reach, places[columns] * reach
            away = np.hypot(x, y)
            tip = away > away.max() - 0.25
            bearing = np.degrees(np.arctan2(-y[tip].mean(), -x[tip].mean()))
            off = (bearing - azimuth + 180.0) % 360.0 - 180.0
            height = np.degrees(np.arctan2(_POLE_M, away.max()))
            worst = max(worst, abs(float(off)), abs(float(height) - altitude))
    return worst
