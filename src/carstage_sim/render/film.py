"""A camera's film: how exposed light becomes 8-bit codes, from CARLA's exposure attributes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.crew import do
from carstage_sim.render.sky import Lighting

_STEPS: Any = np.float32(8191.0)
CLEAR_NOON_EXPOSURE = 0.396
"""Automatic exposure of ``carla.WeatherParameters.ClearNoon``."""
_NOON_EV, _NIGHT_EV = 12.0, 10.0
"""What the bounds of automatic exposure stand for: a clear noon, and the darkest that there is."""
_NIGHT_STOPS = 4.5
"""Stops between the automatic exposures of a clear noon and of a night."""
_USUAL_EV = math.log2(1.4**2 * 200.0)
"""Exposure value of CARLA's defaults: f/1.4, 1/200 s, ISO 100."""
_USUAL_GAMMA = 2.2
_MIDDLE: Any = np.float32(0.52)
_BESIDE: Any = np.float32(0.1)
_ACROSS: Any = np.float32(0.02)
"""Weights of a pixel, of those beside it and of those across, in the mean of nine."""


BRIGHTEST = 7.0
"""Exposed light that stands for all that fills the film, in units of white."""
EVEN = 2
"""Mark of a pixel that becomes the mean of the nine around it."""


@dataclass(frozen=True, slots=True)
class Film:
    """Exposure and gamma of a camera; the defaults are CARLA's.

    Attributes:
        manual: exposed by shutter, aperture and ISO instead of by the light that there is.
        compensation_ev: brighter (positive) or darker, in stops.
        darkest_ev, brightest_ev: bounds of the automatic exposure: 12 is that of a clear noon, 10
            that of the darkest night.
        shutter_per_s: reciprocal of the exposure time.
        iso: sensitivity.
        f_stop: aperture.
        gamma: of the display; 2.2 is sRGB's own curve.
        adapted_stops: the automatic exposure while it still follows a change of the light, in stops
            over that of a clear noon; None: that of the light.
    """

    manual: bool = False
    compensation_ev: float = 0.0
    darkest_ev: float = _NIGHT_EV
    brightest_ev: float = _NOON_EV
    shutter_per_s: float = 200.0
    iso: float = 100.0
    f_stop: float = 1.4
    gamma: float = _USUAL_GAMMA
    adapted_stops: float | None = None

    def exposed(self, light: Lighting) -> Lighting:
        """The same light with this film's exposure.

        The exposure value is that of ISO 2720, ``log2(f_stop^2 * shutter * 100 / iso)``; with the
        defaults a manual exposure is right for a clear noon.
        """
        if self.manual:
            ev = math.log2(self.f_stop**2 * self.shutter_per_s * 100.0 / self.iso)
            exposure = CLEAR_NOON_EXPOSURE * 2.0 ** (_USUAL_EV - ev)
        elif self.adapted_stops is not None:
            exposure = CLEAR_NOON_EXPOSURE * 2.0**self.adapted_stops
        else:
            exposure = self._automatic(float(light.exposure))
        exposure *= 2.0**self.compensation_ev
        return light._replace(exposure=np.float32(exposure))

    def sensitivity(self, light: Lighting) -> float:
        """ISO value that the exposure takes: 100 for a clear noon.

        Light that is a stop weaker takes twice as much, as the shutter stays.
        """
        if self.manual:
            return self.iso
        return 100.0 * float(self.exposed(light).exposure) / CLEAR_NOON_EXPOSURE

    def stops(self, automatic: float) -> float:
        """Stops over a clear noon's of the automatic exposure of a light, within the bounds."""
        return math.log2(self._automatic(automatic) / CLEAR_NOON_EXPOSURE)

    def _automatic(self, automatic: float) -> float:
        """An automatic exposure within the bounds."""
        stops = math.log2(automatic / CLEAR_NOON_EXPOSURE)
        wanted = _NOON_EV - stops * (_NOON_EV - _NIGHT_EV) / _NIGHT_STOPS
        # A clear noon and a night may lie a little outside of what their values stand for.
        low = self.darkest_ev if self.darkest_ev > _NIGHT_EV else -math.inf
        high = self.brightest_ev if self.brightest_ev < _NOON_EV else math.inf
        ev = min(max(wanted, low), high)
        return automatic * float(2.0 ** ((wanted - ev) * _NIGHT_STOPS / (_NOON_EV - _NIGHT_EV)))

    def encode(self, colours: NDArray[np.float32]) -> NDArray[np.uint8]:
        """8-bit codes of linear display light, 0-1."""
        places = (colours * _STEPS + np.float32(0.5)).astype(np.int32)
        codes: NDArray[np.uint8] = film_codes(self.gamma)[places]
        return codes


@lru_cache(maxsize=8)
def film_codes(gamma: float) -> NDArray[np.uint8]:
    """``(8192,)`` codes of linear values in steps of 1/8191.

    sRGB's curve, bent when the gamma is another.
    """
    linear = np.arange(8192) / 8191.0
    curve = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    if gamma != _USUAL_GAMMA:
        curve = curve ** (_USUAL_GAMMA / gamma)
    codes: NDArray[np.uint8] = np.rint(curve * 255.0).astype(np.uint8)
    return codes


@lru_cache(maxsize=8)
def display_of_codes(gamma: float) -> NDArray[np.float32]:
    """``(256,)`` float32 linear display light, 0-1, that :func:`film_codes` gives each code.

    It is the middle of what has that code, so that the code comes back.
    """
    codes = film_codes(gamma)
    first = np.searchsorted(codes, np.arange(256), "left")
    last = np.searchsorted(codes, np.arange(256), "right") - 1
    # A steep curve skips codes: the next one stands for them.
    middle = np.where(last >= first, (first + last) // 2, np.minimum(first, 8191))
    return (middle / 8191.0).astype(np.float32)


@lru_cache(maxsize=8)
def light_of_codes(gamma: float) -> NDArray[np.float32]:
    """``(256,)`` float32 exposed light that the film shows as each code; 1 is white.

    The film saturates: display light is ``1 - exp(-light)``. Codes tell up to 5.4 apart; what is
    brighter counts as :data:`BRIGHTEST`.
    """
    display = display_of_codes(gamma).tolist()
    light = [-math.log(1.0 - one) if one < 1.0 else BRIGHTEST for one in display]
    light = [min(one, BRIGHTEST) for one in light]
    light[255] = BRIGHTEST
    # To six digits: a logarithm's last bit differs between machines.
    return np.array([round(one, 6) + 0.0 for one in light], np.float32)


@device
def develop(codes, red, green, blue, i, pixels):  # type: ignore[no-untyped-def]
    """Write a pixel, BGRA, of linear display light, as :meth:`Film.encode` codes it.

    ``pixels``: ``(N, 4)`` uint8.
    """
    half = np.float32(0.5)
    pixels[i, 0] = codes[int(blue * _STEPS + half)]
    pixels[i, 1] = codes[int(green * _STEPS + half)]
    pixels[i, 2] = codes[int(red * _STEPS + half)]
    pixels[i, 3] = 255


@device
def _develop_means_part(codes, colours, again, edges, pixels, worker, first, last):  # type: ignore[no-untyped-def]
    samples = again.shape[0] // max(edges.shape[0], 1)
    share = np.float32(samples + 1)
    for e in range(first, last):
        i = edges[e]
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for k in range(e * samples, e * samples + samples):
            red, green, blue = red + again[k, 0], green + again[k, 1], blue + again[k, 2]
        red, green, blue = red + colours[i, 0], green + colours[i, 1], blue + colours[i, 2]
        develop(codes, red / share, green / share, blue / share, i, pixels)


@kernel
def develop_means(data, board, job, work):  # type: ignore[no-untyped-def]
    """As :func:`develop`, of pixels that several rays went through.

    The data are codes of the film's gamma, ``(N, 3)`` float32 of the pixels' centres,
    ``(E * K, 3)`` float32 of the other rays of each of these pixels, ``(E,)`` their numbers, and
    ``(N, 4)`` uint8 BGRA that receives them. Its items are those numbers.
    """
    do(_develop_means_part, data, board, job, work)


@device
def weight_in_mean(right, down):  # type: ignore[no-untyped-def]
    """Weight of a pixel in the mean of nine; ``right``, ``down``: 0 or 1 pixels from the middle.

    The squares add up to a third, so noise is left as of three rays.
    """
    if right + down == 0:
        return _MIDDLE
    return _BESIDE if right + down == 1 else _ACROSS


@device
def develop_even(codes, colours, marks, width, first, last, pixels):  # type: ignore[no-untyped-def]
    """As :func:`develop`, of pixels that become the mean of the nine around them.

    Args:
        codes: of the film's gamma.
        colours: ``(N, 3)`` float32 of the pixels' centres.
        marks: ``(N,)`` uint8, ``EVEN`` for these pixels, of which none is at the border.
        width: of the picture.
        first, last: half-open range of pixels to look at.
        pixels: ``(N, 4)`` uint8 BGRA, receives them.
    """
    for i in range(first, last):
        if marks[i] != EVEN:
            continue
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for down in range(-1, 2):
            for right in range(-1, 2):
                j = i + down * width + right
                weight = weight_in_mean(abs(right), abs(down))
                red += weight * colours[j, 0]
                green += weight * colours[j, 1]
                blue += weight * colours[j, 2]
        develop(codes, red, green, blue, i, pixels)
