"""The loops that make a flash LiDAR's echoes of depth pictures, compiled.

Only sums, products, quotients and roots are used, so that points have the same bits on every
processor.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.conversion.reprojection_kernel import (
    FAR_CODE,
    FAR_FROM,
    NOTHING,
    depth_code,
)
from carstage.geometry.flash_beams import STEEPEST
from carstage.kernels import compiled

METRES_PER_CODE: Final = 1000.0 / (2**24 - 1)
"""CARLA's depth camera: 24 bits for 1000 m."""
CHOSEN_FIRST: Final = 0
CHOSEN_STRONGEST: Final = 1
CHOSEN_LAST: Final = 2
CHOSEN_DUAL: Final = 3
CHOSEN_ALL: Final = 4
_HALVINGS: Final = 10
_TERMS: Final = 10
_DRAWS: Final = 32
"""Random numbers that are set aside for each echo of a beam."""
_UNIFORMS: Final = 12


@compiled
def sample_surfaces(
    sources: NDArray[np.uint8],
    face: NDArray[np.uint8],
    place: NDArray[np.float64],
    focal_px: float,
    range_m: NDArray[np.float64],
    cosine: NDArray[np.float64],
) -> None:
    """Range and cosine of incidence where rays end; infinity and 0 where nothing was hit.

    A plane ``n . P = d`` has ``1 / z = (n . (x, y, 1)) / d`` at ``x = (u - cx) / f``: one over the
    depth is linear in a pinhole's picture, and its slopes are the normal.

    Args:
        sources: ``(F, h, w, 4)`` depth pictures as CARLA codes them.
        face, place: ``(B, S)`` which of them shows a ray and ``(B, S, 2)`` where (px).
        focal_px: of the sources.
        range_m, cosine: ``(B, S)`` to be filled.
    """
    rows, columns = sources.shape[1], sources.shape[2]
    for b in range(face.shape[0]):
        for s in range(face.shape[1]):
            range_m[b, s], cosine[b, s] = np.inf, 0.0
            which = face[b, s]
            if which == NOTHING:
                continue
            u, v = place[b, s, 0], place[b, s, 1]
            x = min(max(int(u), 0), columns - 1)
            y = min(max(int(v), 0), rows - 1)
            here = depth_code(sources, which, y, x)
            if here >= FAR_FROM * FAR_CODE:
                continue
            middle = 1.0 / max(here, 1.0)
            along_u = smoothest_slope(sources, which, y, x, 0, 1)
            along_v = smoothest_slope(sources, which, y, x, 1, 0)
            inverse = middle + along_u * (u - x - 0.5) + along_v * (v - y - 0.5)
            across, down = u - columns / 2.0, v - rows / 2.0
            stretch = np.sqrt(1.0 + (across * across + down * down) / (focal_px * focal_px))
            range_m[b, s] = stretch * METRES_PER_CODE / inverse
            n_x, n_y = focal_px * along_u, focal_px * along_v
            n_z = inverse - across * along_u - down * along_v
            normal = np.sqrt(n_x * n_x + n_y * n_y + n_z * n_z)
            cosine[b, s] = min(max(inverse / (normal * stretch), STEEPEST), 1.0)


@compiled
def sample_objects(
    sources: NDArray[np.uint8],
    face: NDArray[np.uint8],
    place: NDArray[np.float64],
    objects: NDArray[np.uint32],
    tags: NDArray[np.uint32],
) -> None:
    """Objects of the pixels that :func:`sample_surfaces` takes; 0 where no picture shows a ray.

    Args:
        sources: ``(F, h, w, 4)`` instance pictures as CARLA codes them, with the pixels of the
            depth pictures.
        face, place: as there.
        objects, tags: ``(B, S)`` to be filled.
    """
    rows, columns = sources.shape[1], sources.shape[2]
    for b in range(face.shape[0]):
        for s in range(face.shape[1]):
            objects[b, s], tags[b, s] = 0, 0
            if face[b, s] != NOTHING:
                x = min(max(int(place[b, s, 0]), 0), columns - 1)
                y = min(max(int(place[b, s, 1]), 0), rows - 1)
                blue, green, red = sources[face[b, s], y, x, :3]
                objects[b, s], tags[b, s] = np.uint32(green) + np.uint32(256) * blue, red


@compiled
def smoothest_slope(
    sources: NDArray[np.uint8], which: int, row: int, column: int, down: int, right: int
) -> float:
    """Slope of one over the depth code at a pixel, per pixel down or to the right.

    Of three neighbours in a row before, around and behind the pixel, those are taken that lie
    most nearly on a line: at an edge they are the object's own, as in the ENO schemes (Harten et
    al. 1987). 0 where there is no neighbour.
    """
    rows, columns = sources.shape[1], sources.shape[2]
    best, slope = np.inf, 0.0
    values = np.empty(5)
    for step in range(-2, 3):
        v, u = row + step * down, column + step * right
        inside = 0 <= v < rows and 0 <= u < columns
        values[step + 2] = 1.0 / max(depth_code(sources, which, v, u), 1.0) if inside else np.nan
    for first in range(3):
        bend = abs(values[first] - 2.0 * values[first + 1] + values[first + 2])
        if bend < best:
            best = bend
            low, high = max(first, 1), min(first + 2, 3)
            slope = (values[high] - values[low]) / (high - low)
    return slope


@compiled
def find_echoes(
    range_m: NDArray[np.float64],
    cosine: NDArray[np.float64],
    limits_m: tuple[float, float],
    optics: tuple[float, float, float, float],
    echo_m: NDArray[np.float64],
    echo_power: NDArray[np.float64],
    echo_sample: NDArray[np.int64],
    count: NDArray[np.int64],
) -> None:
    """Echoes of each beam, the nearest first: ranges, and powers in 1/m^2.

    Samples whose ranges follow each other without a gap are one echo. Each spans the range that
    its share of the footprint has on its surface, so a slope is one echo however far away.

    Args:
        range_m, cosine: ``(B, S)`` of the samples.
        limits_m: nearest and farthest range that is measured.
        optics: side of a sample's share of the footprint (rad), gap between two echoes (m), then
            ``reflectivity`` and ``attenuation_per_m`` of ``FlashSpec``.
        echo_m, echo_power: ``(B, S)``, to be filled.
        echo_sample: ``(B, S)``, to be filled: the sample of each echo with the most power.
        count: ``(B,)``, to be filled.
    """
    share = 1.0 / range_m.shape[1]
    sample_rad, separation_m, reflectivity, attenuation_per_m = optics
    for b in range(range_m.shape[0]):
        order = np.argsort(range_m[b])
        found, end_m, most = 0, -np.inf, -1.0
        for s in order:
            at_m = range_m[b, s]
            if not limits_m[0] <= at_m <= limits_m[1]:
                continue
            cos = cosine[b, s]
            half_m = 0.5 * sample_rad * at_m * np.sqrt(1.0 - cos * cos) / cos
            power = share * reflectivity * cos * attenuation(2.0 * attenuation_per_m * at_m)
            power /= at_m * at_m
            if found == 0 or at_m - half_m - end_m > separation_m:
                echo_m[b, found], echo_power[b, found] = 0.0, 0.0
                found += 1
                end_m, most = at_m + half_m, -1.0
            echo_m[b, found - 1] += power * at_m
            echo_power[b, found - 1] += power
            if power > most:
                echo_sample[b, found - 1], most = s, power
            end_m = max(end_m, at_m + half_m)
        for e in range(found):
            echo_m[b, e] /= echo_power[b, e]
        count[b] = found


@compiled
def report_echoes(
    echo_m: NDArray[np.float64],
    echo_power: NDArray[np.float64],
    count: NDArray[np.int64],
    seed: np.uint64,
    limits_m: tuple[float, float],
    chances: tuple[float, float, float, float, float],
    returns: int,
    reported: NDArray[np.float64],
) -> int:
    """Which echoes are seen and reported, beam by beam, the nearest first; their number.

    Args:
        echo_m, echo_power, count: see :func:`find_echoes`.
        seed: of this frame.
        limits_m: nearest and farthest range that is measured.
        chances: power that is just seen (0: every echo is), then ``noise_stddev_m``,
            ``ambient_noise``, ``false_return_rate`` and ``dropoff_rate`` of ``FlashSpec``.
        returns: one of the numbers ``CHOSEN_...``.
        reported: ``(N, 4)`` number of the beam, range, power and number of the echo among the
            beam's, -1 of a false one; to be filled.
    """
    seen = np.empty((echo_m.shape[1] + 1, 3))
    total = 0
    for b in range(echo_m.shape[0]):
        stream = mixed(seed ^ mixed(np.uint64(b)))
        found = see_echoes(echo_m[b, : count[b]], echo_power[b], stream, limits_m, chances, seen)
        if found == 0:
            continue
        order = np.argsort(seen[:found, 0])
        strongest, last = order[0], order[found - 1]
        for i in order:
            if seen[i, 1] > seen[strongest, 1]:
                strongest = i
        second = -1
        if strongest == last:
            for i in order:
                if i != last and (second < 0 or seen[i, 1] > seen[second, 1]):
                    second = i
        for place in range(found):
            i = order[place]
            if (
                returns == CHOSEN_ALL
                or (returns == CHOSEN_FIRST and place == 0)
                or (returns == CHOSEN_LAST and i == last)
                or (returns == CHOSEN_STRONGEST and i == strongest)
                or (returns == CHOSEN_DUAL and i in (strongest, last, second))
            ):
                reported[total, 0] = b
                reported[total, 1:] = seen[i]
                total += 1
    return total


@compiled
def see_echoes(
    echo_m: NDArray[np.float64],
    echo_power: NDArray[np.float64],
    stream: np.uint64,
    limits_m: tuple[float, float],
    chances: tuple[float, float, float, float, float],
    seen: NDArray[np.float64],
) -> int:
    """Range, power and place of a beam's echoes that are seen, and of a false one; their number.

    Args:
        echo_m, echo_power: of the beam's echoes.
        stream: of the beam's random numbers.
        limits_m, chances: see :func:`report_echoes`.
        seen: ``(N, 3)`` to be filled.
    """
    weakest, noise_stddev_m, ambient_noise, false_return_rate, dropoff_rate = chances
    found = 0
    for e in range(len(echo_m)):
        first = _DRAWS * (e + 1)
        if dropoff_rate > 0.0 and uniform(stream, first) < dropoff_rate:
            continue
        if weakest > 0.0:
            signal = echo_power[e] / weakest
            if ambient_noise > 0.0:
                signal += ambient_noise * normal(stream, first + 1)
            if signal < 1.0:
                continue
        at_m = echo_m[e]
        if noise_stddev_m > 0.0:
            at_m += noise_stddev_m * normal(stream, first + 1 + _UNIFORMS)
        if at_m > 0.0:
            seen[found, 0], seen[found, 1], seen[found, 2] = at_m, echo_power[e], e
            found += 1
    if false_return_rate > 0.0 and uniform(stream, 0) < false_return_rate:
        seen[found, 0] = limits_m[0] + uniform(stream, 1) * (limits_m[1] - limits_m[0])
        seen[found, 1], seen[found, 2] = weakest, -1
        found += 1
    return found


@compiled
def attenuation(x: float) -> float:
    """``exp(-x)`` for ``x >= 0``: its series at a small part of x, squared again and again."""
    part = -x / 2.0**_HALVINGS
    term, total = 1.0, 1.0
    for i in range(1, _TERMS):
        term *= part / i
        total += term
    for _ in range(_HALVINGS):
        total *= total
    return total


@compiled
def mixed(value: np.uint64) -> np.uint64:
    """Sixty-four bits that depend on all of the value's (SplitMix64; Steele et al. 2014)."""
    value = value + np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@compiled
def uniform(stream: np.uint64, number: int) -> float:
    """The random number in [0, 1) of a stream that has this place."""
    return float(mixed(stream ^ mixed(np.uint64(number))) >> np.uint64(11)) / 2.0**53


@compiled
def normal(stream: np.uint64, first: int) -> float:
    """A number of the standard normal distribution, the sum of twelve uniform ones less six.

    Its variance is exactly 1 and it never exceeds 6 (Irwin 1927, Hall 1927).
    """
    total = -6.0
    for i in range(_UNIFORMS):
        total += uniform(stream, first + i)
    return total
