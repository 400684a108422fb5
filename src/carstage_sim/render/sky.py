"""Sky, sun and air of a weather: a table of sky radiance and the light that it gives.

Clear sky: single scattering by air (Rayleigh) and haze (Mie, Henyey-Greenstein) along each view
ray of a spherical atmosphere, after Nishita et al. (SIGGRAPH 1993), with a constant share for
light scattered more than once. The picture's only table: cameras, reflections and the ambient light
all read it. Radiance is in units in which sunlight above the air has irradiance 20.
"""

from __future__ import annotations

import math
import threading
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.daylight import (
    ABOVE_AIR_KLX,
    CLEAR_UP_TO,
    luminance,
    sky_gain,
    sun_left,
)
from carstage_sim.world.state import Weather
from carstage_sim.world.street_lights import LAMPS_ON_BELOW_DEG

Array = NDArray[np.float64]

ROWS, COLUMNS = 192, 1024
"""Size of the sky table: rows from the horizon to the zenith, columns around, yaw 0 first."""

_SUN_IRRADIANCE = 20.0
_KLX = ABOVE_AIR_KLX / _SUN_IRRADIANCE
"""Illuminance of an irradiance of luminance 1."""
_PLANET_M = 6_360_000.0
_AIR_TOP_M = 60_000.0
_RAYLEIGH_PER_M = np.array([7.2e-6, 13.7e-6, 32.4e-6])
"""What air scatters of sunlight (5,778 K, CIE 1931) in sRGB's primaries, which are broad bands."""
_USUAL_RAYLEIGH, _USUAL_MIE = 0.0331, 0.03
"""CARLA's defaults of the two scattering scales: the air as it is on Earth."""
_OZONE_PER_M = np.array([0.8e-6, 2.3e-6, 0.1e-6])
"""Ozone as if mixed into the air: takes the green out of long paths."""
_MIE_PER_M = 12e-6
_RAYLEIGH_SCALE_M, _MIE_SCALE_M = 8_000.0, 1_200.0
_MIE_ASYMMETRY = 0.76
_SKY_GAIN = 1.35
"""Single scattering is too dark by about this much."""
_EXPOSURE, _ADAPTATION = 1.571, 0.52
"""A white wall at noon comes out at 1.7 times the curve's unit, by night at about 0.15."""
_SUNLIT, _BY_DAY = 18.7, 0.12
"""Light of what faces the sun by a clear noon, and how much more a camera adapts by day where
nothing is as bright."""
_SKY_SHARE = 0.55
"""What is seen of the sky from the middle of a street, its houses three quarters of its width high:
the cosine of ``atan(2 * 0.75)``."""
_WALL_HUE = np.array([1.08, 1.0, 0.92])
"""Plaster, brick, concrete and the street between them throw back more red than blue."""
_LIT_WALLS = 0.6
"""Share of the sun that reaches walls past the houses opposite."""
_NIGHT_SKY = np.array([0.0015, 0.0022, 0.0045])
_LAMPLIT_RAIN = np.array([0.0085, 0.0058, 0.0030])
"""Light of the town's lamps that heavy rain scatters by night."""
_THICK_RAIN = 0.25
"""So much rain scatters two thirds of that: thick air gets no lighter where it is thicker."""
_AWAY_M = 20.0
"""How far away from a camera most of what it sees is."""
_TOWN_GLOW = np.array([0.0064, 0.0043, 0.0024])
"""Light of the town's lamps that the air above it scatters, at the horizon."""
_GLOW_RAD = 0.16
"""At this elevation a half of it is left."""
_MOST_STARRY_CLOUD = 0.3
_FALL_PER_M = 0.1
"""Fog's loss per metre at ``fog_falloff`` 1 (Unreal: the fall-off is over 10 m of height)."""


class Lighting(NamedTuple):
    """What shading needs to know of the weather, in world axes.

    Attributes:
        sun_direction: ``(3,)`` float32 unit vector towards the sun (at night: the moon).
        sun: ``(3,)`` float32 irradiance of a surface that faces it.
        sky: ``(ROWS, COLUMNS, 3)`` float32 radiance; row = ROWS * sqrt(elevation / 90 deg).
        ambient: ``(3, 3)`` float32 irradiance of surfaces that face up, sideways and down.
        fog: ``(3,)`` float32 radiance of the fog.
        fog_glow: ``(3,)`` float32 radiance that it has more of towards the sun.
        fog_per_m: float32 extinction of the fog at height 0.
        fog_fall_per_m: float32 share of it that is lost with each metre of height, >= 1e-5.
        fog_from_m: float32 distance at which it begins.
        wetness, puddles: float32 0-1: how wet the ground is, how much water stands on it.
        rain, wind: float32 0-1: how much of it falls, how hard it blows.
        night: float32 0-1: how far lamps are on.
        lamp: float32 radiance of a lamp of strength 1, which the automatic exposure shows as white.
        stars: float32 radiance of a star as bright as such a lamp; 0 by day and under clouds.
        exposure: float32 factor from radiance to the film.
        time_s: float32 time that lets blinkers blink.
    """

    sun_direction: NDArray[np.float32]
    sun: NDArray[np.float32]
    sky: NDArray[np.float32]
    ambient: NDArray[np.float32]
    fog: NDArray[np.float32]
    fog_glow: NDArray[np.float32]
    fog_per_m: np.float32
    fog_fall_per_m: np.float32
    fog_from_m: np.float32
    wetness: np.float32
    puddles: np.float32
    rain: np.float32
    wind: np.float32
    night: np.float32
    lamp: np.float32
    stars: np.float32
    exposure: np.float32
    time_s: np.float32


def _path(cosine: Array, height: float | Array, top_m: float) -> Array:
    """Length of a ray from ``height`` (m) to the top of the air at a zenith angle's cosine."""
    radius = _PLANET_M + height
    length: Array = -radius * cosine + np.sqrt(
        radius**2 * (cosine**2 - 1.0) + (_PLANET_M + top_m) ** 2
    )
    return length


def _sun_depth(height: Array, cosine: Array) -> tuple[Array, Array]:
    """Optical lengths (m of sea-level air) towards the sun: Rayleigh, Mie; huge below ground."""
    length = _path(cosine, height, _AIR_TOP_M)
    radius = _PLANET_M + height
    rayleigh = np.zeros_like(length)
    mie = np.zeros_like(length)
    lowest = np.full_like(length, np.inf)
    steps = 12
    for k in range(steps):
        # Denser near the start, where the air is.
        begin, end = (k / steps) ** 2, ((k + 1) / steps) ** 2
        s = length * (begin + end) / 2
        h = np.sqrt(radius**2 + s**2 + 2 * radius * s * cosine) - _PLANET_M
        lowest = np.minimum(lowest, h)
        rayleigh += np.exp(-np.maximum(h, 0) / _RAYLEIGH_SCALE_M) * length * (end - begin)
        mie += np.exp(-np.maximum(h, 0) / _MIE_SCALE_M) * length * (end - begin)
    blocked = np.where(lowest < -2000.0, 1e9, 0.0)
    return rayleigh + blocked, mie + blocked


class Air(NamedTuple):
    """What floats in the air, relative to a clear day on Earth.

    Attributes:
        haze: particles that scatter all colours forwards.
        blue: molecules that scatter blue everywhere.
    """

    haze: float
    blue: float


def _sunlight(altitude_rad: float, air: Air) -> Array:
    """Irradiance of a surface that faces the sun, at the ground."""
    cosine = np.array([np.sin(altitude_rad)])
    rayleigh, mie = _sun_depth(np.array([2.0]), cosine)
    depth = (air.blue * _RAYLEIGH_PER_M + _OZONE_PER_M) * rayleigh + _MIE_PER_M * air.haze * mie
    light: Array = _SUN_IRRADIANCE * np.exp(-depth)
    return light


def _clear_sky(altitude_rad: float, air: Air, rows: int, columns: int) -> Array:
    """``(rows, columns, 3)`` radiance over elevation and azimuth 0..pi from the sun's."""
    elevation = _elevations(rows)[:, None] + 1e-3
    turn = np.linspace(0.0, np.pi, columns)[None, :]
    up = np.sin(elevation) + 0 * turn
    sun = np.array([np.cos(altitude_rad), 0.0, np.sin(altitude_rad)])
    towards_sun = np.cos(elevation) * np.cos(turn) * sun[0] + up * sun[2]
    length = _path(up, 2.0, _AIR_TOP_M)
    radiance = np.zeros((rows, columns, 3))
    rayleigh_depth = np.zeros((rows, columns))
    mie_depth = np.zeros((rows, columns))
    steps = 20
    for k in range(steps):
        begin, end = (k / steps) ** 2, ((k + 1) / steps) ** 2
        s, ds = length * (begin + end) / 2, length * (end - begin)
        radius = np.sqrt(_PLANET_M**2 + s**2 + 2 * _PLANET_M * s * up)
        h = np.maximum(radius - _PLANET_M, 0.0)
        rayleigh = np.exp(-h / _RAYLEIGH_SCALE_M) * ds
        mie = np.exp(-h / _MIE_SCALE_M) * ds
        cosine = (_PLANET_M * sun[2] + s * towards_sun) / radius
        sun_rayleigh, sun_mie = _sun_depth(h, cosine)
        depth = (air.blue * _RAYLEIGH_PER_M + _OZONE_PER_M) * (
            rayleigh_depth + rayleigh / 2 + sun_rayleigh
        )[..., None] + 1.1 * _MIE_PER_M * air.haze * (mie_depth + mie / 2 + sun_mie)[..., None]
        arriving = np.exp(-depth)
        phase_rayleigh = 3 / (16 * np.pi) * (1 + towards_sun**2)
        g = _MIE_ASYMMETRY
        phase_mie = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * towards_sun) ** 1.5)
        # An isotropic share stands for light that was scattered more than once.
        several = 0.7 / (4 * np.pi)
        radiance += arriving * (
            air.blue * _RAYLEIGH_PER_M * (rayleigh * (phase_rayleigh + several))[..., None]
            + _MIE_PER_M * air.haze * (mie * (phase_mie + several))[..., None]
        )
        rayleigh_depth += rayleigh
        mie_depth += mie
    return radiance * _SUN_IRRADIANCE * _SKY_GAIN


def _elevations(rows: int) -> Array:
    """Elevation (rad) of each row: dense at the horizon."""
    return (np.arange(rows) / (rows - 1)) ** 2 * (np.pi / 2)


def _value_noise(x: Array, y: Array, seed: int) -> Array:
    """Smooth noise in 0-1 on a lattice of whole numbers."""

    def corner(i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
        h = (i * 374761393 + j * 668265263 + seed * 974711) & 0xFFFFFFFF
        h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
        mixed: Array = ((h ^ (h >> 16)) & 0xFFFF) / 65535.0
        return mixed

    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    u, v = x - i, y - j
    u, v = u * u * (3 - 2 * u), v * v * (3 - 2 * v)
    low = corner(i, j) * (1 - u) + corner(i + 1, j) * u
    high = corner(i, j + 1) * (1 - u) + corner(i + 1, j + 1) * u
    noise: Array = low * (1 - v) + high * v
    return noise


@cache
def _cloud_noise() -> Array:
    """``(ROWS, COLUMNS)`` fractal noise in about 0-1, as if on a layer high above; read-only."""
    elevation = _elevations(ROWS)[:, None]
    azimuth = np.arange(COLUMNS)[None, :] * (2 * np.pi / COLUMNS)
    reach = np.cos(elevation) / (np.sin(elevation) + 0.12) * 1.6
    x, y = reach * np.cos(azimuth) + 40.0, reach * np.sin(azimuth) + 40.0
    total = np.zeros((ROWS, COLUMNS))
    weight, scale = 0.5, 1.0
    for octave in range(6):
        total += weight * _value_noise(x * scale + 3.7 * octave, y * scale, octave)
        weight, scale = weight / 2, scale * 2.03
    total.flags.writeable = False
    return total


_EXPOSURES = 256
"""Weathers whose exposures are kept."""


class SkyModel:
    """Makes lighting from weather; keeps the last one, since weather seldom changes."""

    def __init__(self) -> None:
        self._noise = _cloud_noise()
        self._last: tuple[Weather, Lighting] | None = None
        self._exposures: dict[Weather, float] = {}
        self._lock = threading.Lock()

    def lighting(self, weather: Weather, time_s: float) -> Lighting:
        """Light of a weather; ``time_s`` lets blinkers blink."""
        with self._lock:
            return self._light_of(weather)._replace(time_s=np.float32(time_s % 3600.0))

    def exposure(self, weather: Weather) -> float:
        """The automatic exposure of a weather; that of some before is known."""
        with self._lock:
            if weather not in self._exposures:
                self._light_of(weather)
            return self._exposures[weather]

    def _light_of(self, weather: Weather) -> Lighting:
        if self._last is None or self._last[0] != weather:
            self._last = (weather, _lighting(weather, self._noise))
            if weather not in self._exposures and len(self._exposures) >= _EXPOSURES:
                del self._exposures[next(iter(self._exposures))]
            self._exposures[weather] = float(self._last[1].exposure)
        return self._last[1]


def _lighting(weather: Weather, noise: Array) -> Lighting:
    altitude = np.radians(np.clip(weather.sun_altitude_angle, -90.0, 90.0))
    azimuth = np.radians(weather.sun_azimuth_angle)
    cloud = np.clip(weather.cloudiness / 100.0, 0.0, 1.0)
    fogginess = np.clip(weather.fog_density / 100.0, 0.0, 1.0)
    air = Air(
        haze=(0.7 + 4.0 * fogginess + 1.5 * cloud) * _particles(weather),
        blue=min(max(weather.rayleigh_scattering_scale, 0.0) / _USUAL_RAYLEIGH, 10.0),
    )
    sun_direction = np.array(
        [
            np.cos(altitude) * np.cos(azimuth),
            np.cos(altitude) * np.sin(azimuth),
            np.sin(altitude),
        ]
    )
    sun = _sunlight(altitude, air) if altitude > np.radians(-1.5) else np.zeros(3)
    half = _clear_sky(max(altitude, np.radians(-18.0)), air, 48, 49)
    sky = _spread(half, azimuth) + _NIGHT_SKY
    clear_up = _irradiance(sky)[0]
    night = float(np.clip((np.radians(LAMPS_ON_BELOW_DEG) - altitude) / np.radians(10.0), 0.0, 1.0))
    clouds = (sun * max(np.sin(altitude), 0.03) * 0.75 + clear_up * 0.8) / np.pi
    sky = _clouded(sky, clouds, noise, float(cloud))
    own_klx = _KLX * luminance(_irradiance(sky)[0])
    sky = sky * sky_gain(float(cloud), altitude, own_klx)
    sky = sky + night * _town_glow(cloud)
    sun = sun * _sun_through(altitude, float(cloud))
    if night > 0.5 and sun.max() < 0.02:
        moon = np.array([0.4, -0.5, 0.75])
        sun_direction = moon / np.linalg.norm(moon)
        sun = np.array([0.030, 0.036, 0.048]) * (1.0 - 0.8 * cloud)
    ambient = _irradiance(sky)
    # Light that houses and street throw back fills shadows: it has the colour of the sunlit walls.
    walls = _WALL_HUE * (ambient[1] + _LIT_WALLS * sun * np.hypot(*sun_direction[:2]) / np.pi)
    thrown_back = ambient.mean(axis=1, keepdims=True) * (walls / walls.mean())
    ambient = 1.25 * (_SKY_SHARE * ambient + (1.0 - _SKY_SHARE) * thrown_back)
    ground = (ambient[0] + sun * max(sun_direction[2], 0.0)) * 0.22
    ambient[1] = ambient[1] * 0.5 + 0.5 * ground
    ambient[2] = ground
    rain = np.clip(weather.precipitation / 100.0, 0.0, 1.0)
    fog, fog_glow, fog_per_m = _fog(weather, sky, sun, sun_direction)
    lamplit = night * (1.0 - math.exp(-rain / _THICK_RAIN)) * _LAMPLIT_RAIN
    fog = fog + lamplit
    deposits = np.clip(weather.precipitation_deposits / 100.0, 0.0, 1.0)
    # Where water stands in puddles, the ground around them is damp.
    wet = max(np.clip(weather.wetness / 100.0, 0.0, 1.0), rain, float(deposits))
    # A camera adapts, but not fully: nights stay darker than days. It sees the lit fog, too.
    level = float((ambient[0] + sun * max(sun_direction[2], 0.15)).mean())
    level += np.pi * float(lamplit.mean()) * (1.0 - math.exp(-fog_per_m * _AWAY_M))
    exposure = _EXPOSURE / (level + 0.002) ** _ADAPTATION
    brightest = float((ambient[0] + sun).mean())
    exposure *= max(_SUNLIT / brightest, 1.0) ** (_BY_DAY * (1.0 - night))
    return Lighting(
        sun_direction.astype(np.float32),
        sun.astype(np.float32),
        sky.astype(np.float32),
        ambient.astype(np.float32),
        fog.astype(np.float32),
        fog_glow.astype(np.float32),
        fog_per_m=np.float32(fog_per_m),
        fog_fall_per_m=np.float32(max(weather.fog_falloff * _FALL_PER_M, 1e-5)),
        fog_from_m=np.float32(max(weather.fog_distance, 0.0)),
        wetness=np.float32(wet),
        puddles=np.float32(deposits),
        rain=np.float32(rain),
        wind=np.float32(np.clip(weather.wind_intensity / 100.0, 0.0, 1.0)),
        night=np.float32(night),
        lamp=np.float32(1.0 / exposure),
        stars=np.float32(_stars(night, cloud, float(rain)) / exposure),
        exposure=np.float32(exposure),
        time_s=np.float32(0.0),
    )


def _clouded(sky: Array, light: Array, noise: Array, cloud: float) -> Array:
    """A clear sky with clouds before it.

    Args:
        sky: ``(ROWS, COLUMNS, 3)`` radiance without them.
        light: ``(3,)`` radiance of a thin cloud, lit by the sun through itself and by the sky.
        noise: ``(ROWS, COLUMNS)`` where they are.
        cloud: cloudiness, 0-1.
    """
    if cloud <= 0.0:
        return sky
    overcast = cloud**2
    cover = np.clip((noise - (0.78 - 0.62 * cloud)) / 0.22, 0.0, 1.0)
    cover = cover * cover * (3 - 2 * cover)
    cover = np.clip(cover + max(0.0, overcast * 2.4 - 1.4), 0.0, 1.0)
    bright = light * (1.0 - 0.55 * overcast)
    shade = (1.12 - 0.75 * np.clip(noise - 0.3, 0.0, 1.0) * (0.5 + cloud))[..., None]
    opacity = (cover * min(1.0, 0.35 + 0.9 * cloud))[..., None]
    clouded: Array = sky * (1 - opacity) + opacity * bright * shade
    return clouded


def _sun_through(altitude_rad: float, cloud: float) -> float:
    """Share of the sunlight that clouds leave; few of them dim it by a little only."""
    few = min(cloud, CLEAR_UP_TO)
    dim = (1.0 - 0.97 * few**2 * (few + 0.1)) * (1.0 - 0.25 * few)
    usual = _sunlight(max(altitude_rad, 0.0), Air(haze=0.7 + 1.5 * cloud, blue=1.0))
    return dim * sun_left(cloud, altitude_rad, dim * _KLX * luminance(usual))


def _town_glow(cloud: float) -> Array:
    """``(ROWS, 1, 3)`` radiance of the town's light above it; clouds throw more of it back."""
    share = 1.0 / (1.0 + (_elevations(ROWS) / _GLOW_RAD) ** 2)
    share = share + 0.25 * cloud
    glow: Array = share[:, None, None] * _TOWN_GLOW
    return glow


def _stars(night: float, cloud: float, rain: float) -> float:
    """How much of the stars is seen, 0-1."""
    return night * max(1.0 - cloud / _MOST_STARRY_CLOUD, 0.0) * max(1.0 - 2.0 * rain, 0.0)


def _fog(
    weather: Weather, sky: Array, sun: Array, sun_direction: Array
) -> tuple[Array, Array, float]:
    """Radiance of the fog, what it has more towards the sun, and extinction per metre."""
    density = np.clip(weather.fog_density / 100.0, 0.0, 1.0)
    dust = np.clip(weather.dust_storm / 100.0, 0.0, 1.0)
    rain = np.clip(weather.precipitation / 100.0, 0.0, 1.0)
    scattering = min(max(weather.scattering_intensity, 0.0), 10.0)
    sunlight = sun * max(sun_direction[2], 0.0) / np.pi
    fog = sky[:24].mean(axis=(0, 1)) * (0.6 + 0.4 * scattering) + 0.08 * scattering * sunlight
    glow = 0.05 * scattering * sun * (0.2 + 0.8 * density)
    sand = np.array([1.25, 0.95, 0.55])
    fog = fog * (1 - dust) + dust * fog.mean() * sand
    glow = glow * (1 - dust) + dust * glow.mean() * sand
    clear = 0.00025 * _particles(weather)
    return fog, glow, clear + 0.035 * density**1.5 + 0.0025 * rain + 0.02 * dust


def _particles(weather: Weather) -> float:
    """Pollen and dirt in the air, relative to a usual day."""
    return min(max(weather.mie_scattering_scale, 0.0) / _USUAL_MIE, 20.0)


def _spread(half: Array, sun_azimuth: float) -> Array:
    """The table of all directions from one over azimuths relative to the sun's."""
    rows, columns, _ = half.shape
    azimuth = np.arange(COLUMNS) * (2 * np.pi / COLUMNS) - sun_azimuth
    folded = np.abs((azimuth + np.pi) % (2 * np.pi) - np.pi)
    x = folded / np.pi * (columns - 1)
    i = np.minimum(x.astype(np.int64), columns - 2)
    fraction = (x - i)[None, :, None]
    wide = half[:, i] * (1 - fraction) + half[:, i + 1] * fraction
    y = np.arange(ROWS) / (ROWS - 1) * (rows - 1)
    j = np.minimum(y.astype(np.int64), rows - 2)
    fraction = (y - j)[:, None, None]
    table: Array = wide[j] * (1 - fraction) + wide[j + 1] * fraction
    return table


def _irradiance(sky: Array) -> Array:
    """``(3, 3)`` irradiance of surfaces that face up, sideways (mean over azimuth), and zero."""
    elevation = _elevations(ROWS)
    width = np.gradient(elevation)
    ring = sky.mean(axis=1)
    up = 2 * np.pi * (ring * (np.sin(elevation) * np.cos(elevation) * width)[:, None]).sum(axis=0)
    side = 2 * (ring * (np.cos(elevation) ** 2 * width)[:, None]).sum(axis=0)
    return np.stack([up, side, np.zeros(3)])
