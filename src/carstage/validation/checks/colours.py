"""Whether red and blue are where they should be, told by the sky and by vehicles' paint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.masks import mask_pixels
from carstage.errors import DatasetError
from carstage.validation.checks.findings import Findings

Row = Mapping[str, Any]
Paint = tuple[int, int, int]
DAY_DEG = 20.0
"""Altitude of the sun from which a sky without many clouds is blue."""
MOST_CLOUDS = 70.0
_CLEARLY = 4.0
_FEWEST_SKY_PIXELS = 500
_PAINT_DIFFERENCE = 60
_FEWEST_PAINT_PIXELS = 150
_FEWEST_VEHICLES = 2


@dataclass(slots=True)
class ColourFigures:
    """What speaks for the order of channels, over the pictures of one camera.

    Attributes:
        sky: sum of blue minus red over pixels of a daytime sky.
        sky_pixels: their number.
        paint: by vehicle, sum of (red minus blue) times the sign that its paint has, and pixels.
    """

    sky: float = 0.0
    sky_pixels: int = 0
    paint: dict[int, list[float]] = field(default_factory=dict)

    def add(self, other: ColourFigures) -> None:
        """Add the sums of other pictures."""
        self.sky += other.sky
        self.sky_pixels += other.sky_pixels
        for track, (sum_of_signs, pixels) in other.paint.items():
            total = self.paint.setdefault(track, [0.0, 0.0])
            total[0] += sum_of_signs
            total[1] += pixels

    def add_sky(self, rgb: NDArray[np.uint8], sky: NDArray[np.bool_]) -> None:
        """Count the sky of one picture by day."""
        red, blue = (int(rgb[..., c][sky].sum(dtype=np.int64)) for c in (0, 2))
        self.sky += float(blue - red)
        self.sky_pixels += int(np.count_nonzero(sky))

    def add_paint(
        self, rgb: NDArray[np.uint8], rows: Sequence[Row], paints: Mapping[int, Paint]
    ) -> None:
        """Count the pixels of vehicles whose ``color`` is more red than blue, or less."""
        for row in rows:
            paint = paints.get(row["track_id"])
            if paint is None or row["mask_modal"] is None:
                continue
            try:
                seen = rgb[mask_pixels(row["mask_modal"], rgb.shape[0], rgb.shape[1])]
            except DatasetError:
                continue  # check_silhouettes reports it
            sign = 1.0 if paint[0] > paint[2] else -1.0
            red, blue = (seen[:, c].astype(np.int64) for c in (0, 2))
            total = self.paint.setdefault(row["track_id"], [0.0, 0.0])
            total[0] += sign * float((red - blue).sum())
            total[1] += len(seen)

    @property
    def verdict(self) -> bool | None:
        """Whether the channels are in order; None where nothing tells."""
        if self.sky_pixels >= _FEWEST_SKY_PIXELS:
            mean = self.sky / self.sky_pixels
            if abs(mean) >= _CLEARLY:
                return mean > 0.0
        means = [total / count for total, count in self.paint.values()
                 if count >= _FEWEST_PAINT_PIXELS]  # fmt: skip
        clear = [mean > 0.0 for mean in means if abs(mean) >= _CLEARLY]
        if len(clear) >= _FEWEST_VEHICLES and (all(clear) or not any(clear)):
            return clear[0]
        return None


def paints_of(actors: Mapping[str, Mapping[str, Any]]) -> dict[int, Paint]:
    """Red, green and blue of vehicles whose ``color`` tells red from blue, by track id."""
    found = {}
    for track, actor in actors.items():
        parts = actor["attributes"].get("color", "").split(",")
        if len(parts) == 3 and all(part.strip().isdecimal() for part in parts):
            red, green, blue = (int(part) for part in parts)
            if abs(red - blue) >= _PAINT_DIFFERENCE:
                found[int(track)] = (red, green, blue)
    return found


def check_colours(camera: str, figures: ColourFigures, findings: Findings) -> bool:
    """Report a camera with red and blue exchanged (check ``colour_order``).

    Returns:
        Whether anything told the order.
    """
    verdict = figures.verdict
    if verdict is False:
        findings.add(
            "colour_order",
            "red and blue are exchanged: the sky by day is more red than blue, or vehicles have "
            "the other colour than their attribute `color`",
            sensor=camera,
        )
    return verdict is not None


def is_clear_day(weather: Mapping[str, float]) -> bool:
    """Whether the sky is blue in this weather."""
    return (
        weather.get("sun_altitude_angle", 0.0) >= DAY_DEG
        and weather.get("cloudiness", 100.0) <= MOST_CLOUDS
        and weather.get("fog_density", 0.0) < 10.0
        and weather.get("dust_storm", 0.0) <= 0.0
    )
