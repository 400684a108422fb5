"""Lamps: what glows in which state, and the light of street lamps and headlights."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device
from carstage_sim.maps.street_lamps import StreetLamps
from carstage_sim.render.materials import Glow
from carstage_sim.render.thrown_light import (
    LAMP_INTENSITY,
    NEAR_M,
    NOTHING_THROWN,
    ThrownLight,
    thrown_light,
)

_HEAD, _TAIL, _REVERSE = int(Glow.HEAD_LAMP), int(Glow.TAIL_LAMP), int(Glow.REVERSE_LAMP)
_LEFT, _RIGHT = int(Glow.BLINKER_LEFT), int(Glow.BLINKER_RIGHT)
_BRAKE, _DISPLAY = int(Glow.BRAKE_LAMP), int(Glow.DISPLAY)
_BEACON_BLUE, _BEACON_RED = int(Glow.BEACON_BLUE), int(Glow.BEACON_RED)
_RED, _YELLOW, _GREEN = int(Glow.LENS_RED), int(Glow.LENS_YELLOW), int(Glow.LENS_GREEN)

# Bits of carla.VehicleLightState, values of carla.TrafficLightState.
_POSITION_BIT, _BEAM_BITS, _BRAKE_BIT, _RIGHT_BIT, _LEFT_BIT, _REVERSE_BIT = 1, 6, 8, 16, 32, 64
_SPECIAL_BITS = 512 | 1024
_RED_STATE, _YELLOW_STATE, _GREEN_STATE = 0, 1, 2

CELL_M = 24.0
"""Side of the cells in which street lamps are looked up."""
_PER_CELL, _OF_LAMP = 4, 6
"""Lamps in a cell, and numbers of each: its place and the colour of its light."""
_NOWHERE_M = -1e9
_DX, _DY, _DZ = 3, 4, 5
"""Columns of a beam's direction; its place comes before."""
_REACH_M: Any = np.float32(NEAR_M)
_PER_REACH_M2: Any = np.float32(1 / NEAR_M**2)
_INTENSITY: Any = np.float32(LAMP_INTENSITY)
_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
# Colours of lamps in linear sRGB: the CIE 1931 chromaticities that UN ECE R148 and EN 12368 allow,
# the largest channel 1. Red (0.69, 0.31) has nothing but red in it.
_AMBER_GREEN: Any = np.float32(0.20)
"""Amber, (0.575, 0.425): green."""
_YELLOW_GREEN: Any = np.float32(0.23)
"""Yellow of traffic lights, (0.565, 0.432): green."""
_GREEN_BLUE: Any = np.float32(0.30)
"""Green of traffic lights, (0.20, 0.50): blue."""
_BLUE_GREEN: Any = np.float32(0.03)
"""Blue of beacons, (0.15, 0.07): green."""
_BRAKES: Any = np.float32(3.6)
_STRAY: Any = np.float32(0.006)
"""Share of a lamp's light that lenses and the sensor spread to the other channels: bright cores
are a little paler."""


class Lamps(NamedTuple):
    """Lamps that light their surroundings.

    Attributes:
        street: ``(L, 3)`` float32 world metres of the street lamps.
        power: ``(L, 3)`` float32 linear RGB of their light, 1 for a white new lamp, 0 for one that
            is off.
        cells: ``(X, Y, 4)`` int32 lamps near each cell, -1 for none.
        near: ``(X, Y, 24)`` float32 place and power of each of them.
        corner: ``(2,)`` float32 world x, y of the first cell's corner.
        thrown: ``(X, Y, 32)`` float32 of :meth:`ThrownLight.grid`.
        thrown_corner: ``(2,)`` float32 world x, y of its first node.
        beams: ``(B, 6)`` float32 place and direction of each vehicle's headlights.
    """

    street: NDArray[np.float32]
    power: NDArray[np.float32]
    cells: NDArray[np.int32]
    near: NDArray[np.float32]
    corner: NDArray[np.float32]
    thrown: NDArray[np.float32]
    thrown_corner: NDArray[np.float32]
    beams: NDArray[np.float32]


def lamps_of(street: StreetLamps) -> Lamps:
    """The street lamps of a town, all off, with the cells that they shine into."""
    places, off = street.location.astype(np.float32), np.zeros((len(street), 3), np.float32)
    corner = np.zeros(2, np.float32)
    cells = np.full((1, 1, _PER_CELL), -1, np.int32)
    if len(places):
        corner = places[:, :2].min(axis=0) - np.float32(CELL_M)
        cells = _cells(places, corner)
    no_beams = np.empty((0, 6), np.float32)
    near = _near(places, off, cells)
    return Lamps(places, off, cells, near, corner, NOTHING_THROWN, corner, no_beams)


def _cells(places: NDArray[np.float32], corner: NDArray[np.float32]) -> NDArray[np.int32]:
    size = np.ceil((places[:, :2].max(axis=0) + CELL_M - corner) / CELL_M).astype(int)
    cells = np.full((*size, _PER_CELL), -1, np.int32)
    for i in range(size[0]):
        for j in range(size[1]):
            center = corner + (np.array([i, j]) + 0.5) * CELL_M
            away = np.hypot(*(places[:, :2] - center).T)
            near = np.argsort(away, kind="stable")[:_PER_CELL]
            near = near[away[near] < CELL_M * 0.71 + _REACH_M]
            cells[i, j, : len(near)] = near
    return cells


def _near(
    places: NDArray[np.float32], power: NDArray[np.float32], cells: NDArray[np.int32]
) -> NDArray[np.float32]:
    """``(X, Y, 24)`` place and power of the lamps of each cell; a missing one lies far below."""
    near = np.zeros((*cells.shape, _OF_LAMP), np.float32)
    near[..., 2] = _NOWHERE_M
    there = cells >= 0
    near[there] = np.concatenate([places, power], axis=1)[cells[there]]
    return near.reshape(*cells.shape[:2], -1)


def lamps_switched(lamps: Lamps, power: NDArray[np.float32], thrown: ThrownLight) -> Lamps:
    """The same lamps with another light.

    Args:
        lamps: of a town.
        power: ``(L, 3)`` linear RGB of each lamp's light.
        thrown: what is thrown back of it.
    """
    grid = thrown.grid(power) if power.any() else NOTHING_THROWN
    near = _near(lamps.street, power, lamps.cells)
    return lamps._replace(power=power, near=near, thrown=grid, thrown_corner=thrown.corner)


def headlight_beams(
    rotation: NDArray[np.float32],
    position: NDArray[np.float32],
    bounds: NDArray[np.float32],
    light_state: NDArray[np.uint32],
) -> NDArray[np.float32]:
    """``(B, 6)`` beams of the instances whose low or high beam is on and that can drive."""
    # Traffic lights count states, not bits, and are as narrow as they are high.
    drives = bounds[:, 1, 0] - bounds[:, 0, 0] > 1.2
    (rows,) = np.nonzero(drives & ((light_state & _BEAM_BITS) != 0) & (bounds[:, 0, 2] < 0.3))
    beams = np.empty((len(rows), 6), np.float32)
    for k, row in enumerate(rows):
        front = np.array([bounds[row, 1, 0], 0.0, 0.65], np.float32)
        beams[k, :_DX] = rotation[row] @ front + position[row]
        beams[k, _DX:] = rotation[row] @ np.array([0.997, 0.0, -0.07], np.float32)
    return beams


@device
def glow(kind, bits, time_s):  # type: ignore[no-untyped-def]
    """Light of a lamp of an actor, in units of what the camera shows as white, and its colour."""
    blink = (time_s * np.float32(1.5)) % _ONE < np.float32(0.5)
    strength, r, g, b = _ZERO, _ONE, _STRAY, _STRAY
    if kind == _HEAD and bits & _BEAM_BITS:
        return np.float32(9.0), _ONE, np.float32(0.96), np.float32(0.88)
    if kind == _HEAD and bits & _POSITION_BIT:
        return np.float32(2.0), _ONE, np.float32(0.96), np.float32(0.9)
    if kind == _REVERSE and bits & _REVERSE_BIT:
        return np.float32(3.0), _ONE, _ONE, np.float32(0.95)
    if kind == _BRAKE and bits & _BRAKE_BIT:
        return _BRAKES, r, g, b
    if kind == _TAIL and bits & _BRAKE_BIT:
        strength = _BRAKES
    elif kind == _TAIL and bits & (_POSITION_BIT | _BEAM_BITS):
        strength = np.float32(1.2)
    elif kind == _RED and bits == _RED_STATE:
        strength = np.float32(3.6)
    elif ((kind == _LEFT and bits & _LEFT_BIT) or (kind == _RIGHT and bits & _RIGHT_BIT)) and blink:
        strength, g = np.float32(2.0), _AMBER_GREEN
    elif kind == _YELLOW and bits == _YELLOW_STATE:
        strength, g = np.float32(2.0), _YELLOW_GREEN
    elif kind == _DISPLAY:
        strength, g = np.float32(1.5), _AMBER_GREEN
    elif kind == _GREEN and bits == _GREEN_STATE:
        strength, r, g, b = np.float32(2.6), _STRAY, _ONE, _GREEN_BLUE
    elif bits & _SPECIAL_BITS:
        # Double flashes, red and blue in turn.
        beat = (time_s * np.float32(2.0)) % _ONE
        flash = (beat * np.float32(6.0)) % _ONE < np.float32(0.6)
        if kind == _BEACON_BLUE and flash and beat < np.float32(0.5):
            strength, r, g, b = np.float32(5.0), _STRAY, _BLUE_GREEN, _ONE
        elif kind == _BEACON_RED and flash and beat >= np.float32(0.5):
            strength = np.float32(5.0)
    return strength, r, g, b


@device
def lamp_light(lamps, night, x, y, z, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Irradiance (red, green, blue) from street lamps and headlights at a place, unshadowed.

    What street and houses throw back is in it.
    """
    red, green, blue, white = _ZERO, _ZERO, _ZERO, _ZERO
    across = (x - lamps.corner[0]) * np.float32(1 / CELL_M)
    along = (y - lamps.corner[1]) * np.float32(1 / CELL_M)
    near = lamps.near
    if 0 <= across < np.float32(near.shape[0]) and 0 <= along < np.float32(near.shape[1]):
        i, j = int(across), int(along)
        for number in range(_PER_CELL):
            k = number * _OF_LAMP
            az = near[i, j, k + 2] - z
            if az <= 0:
                continue
            ax, ay = near[i, j, k] - x, near[i, j, k + 1] - y
            square = ax * ax + ay * ay + az * az
            slant = ax * nx + ay * ny + az * nz
            if square > _REACH_M * _REACH_M or slant <= 0:
                continue
            edge = _ONE - square * _PER_REACH_M2
            # The cosines at the surface and at the lamp, over the square of the way.
            share = slant * az * edge * edge / (square * max(square, _ONE))
            red += share * near[i, j, k + 3]
            green += share * near[i, j, k + 4]
            blue += share * near[i, j, k + 5]
    for k in range(lamps.beams.shape[0]):
        ax, ay, az = x - lamps.beams[k, 0], y - lamps.beams[k, 1], z - lamps.beams[k, 2]
        square = ax * ax + ay * ay + az * az
        if square > np.float32(1600.0) or square < np.float32(0.04):
            continue
        away = math.sqrt(square)
        dx, dy, dz = lamps.beams[k, _DX], lamps.beams[k, _DY], lamps.beams[k, _DZ]
        ahead = (ax * dx + ay * dy + az * dz) / away
        if ahead < np.float32(0.85):
            continue
        towards = -(ax * nx + ay * ny + az * nz) / away
        cone = (ahead - np.float32(0.85)) / np.float32(0.15)
        fade = _ONE - square / np.float32(1600.0)
        white += max(towards, _ZERO) * cone * cone * fade / max(square, np.float32(12.0))
    # By day the beams are too weak to be worth their rays.
    white *= np.float32(72.0) * night
    back = thrown_light(lamps, x, y, z, nx, ny, nz)
    return (
        red * _INTENSITY + white + back[0],
        green * _INTENSITY + white * np.float32(0.96) + back[1],
        blue * _INTENSITY + white * np.float32(0.88) + back[2],
    )
