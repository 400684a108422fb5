"""Flash LiDARs of an episode: beams that all measure in one instant, made from depth pictures."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Dict

from carstage.spec.fields import Fields
from carstage.spec.values import Value

FIRST, STRONGEST, LAST, DUAL, ALL = "first", "strongest", "last", "dual", "all"
RETURNS = (FIRST, STRONGEST, LAST, DUAL, ALL)
"""Which echoes of a beam become points; ``dual``: the strongest and the last."""
MOST_BEAMS = 1024
"""Columns, and rows."""
MOST_SAMPLES = 9
MOST_RAYS = 4_000_000


@dataclass(frozen=True, eq=False, repr=False)
class FlashSpec(Value):
    """What a flash LiDAR measures; formulas: ``docs/formats/flash-lidar.md``.

    Attributes:
        columns, rows: beams, in equal steps of azimuth and of elevation.
        horizontal_fov_deg, vertical_fov_deg: what they span, half a step beyond the outer ones.
        min_range_m, range_m: nothing nearer or farther is measured.
        horizontal_divergence_deg, vertical_divergence_deg: full angles of a beam; 0: a line.
        samples: depths per beam, to either side: ``samples ** 2`` over its footprint.
        returns: a word of :data:`RETURNS`.
        echo_separation_m: surfaces of one footprint that are nearer to each other make one echo.
        reflectivity: of every surface, Lambertian.
        range_reflectivity: of the darkest surface that is seen at ``range_m``, square on; 0: no
            echo is too weak.
        attenuation_per_m: of the air, one way.
        full_scale_range_m: where a white surface, square on, has intensity 1; 0: intensity
            without the fall by the square of the range.
        noise_stddev_m: along the beam.
        ambient_noise: standard deviation of background light, as a share of the weakest signal.
        false_return_rate: share of the beams with an echo of background light alone.
        dropoff_rate: share of the echoes lost at random.
    """

    columns: int
    rows: int
    horizontal_fov_deg: float
    vertical_fov_deg: float
    min_range_m: float
    range_m: float
    horizontal_divergence_deg: float
    vertical_divergence_deg: float
    samples: int
    returns: str
    echo_separation_m: float
    reflectivity: float
    range_reflectivity: float
    attenuation_per_m: float
    full_scale_range_m: float
    noise_stddev_m: float
    ambient_noise: float
    false_return_rate: float
    dropoff_rate: float

    @property
    def beams(self) -> int:
        """Number of beams."""
        return self.columns * self.rows

    @property
    def most_points(self) -> int:
        """Points of a frame where every beam has all the echoes that it can have."""
        per_beam = {DUAL: 2, ALL: self.samples**2 + (self.false_return_rate > 0.0)}
        return self.beams * per_beam.get(self.returns, 1)

    @classmethod
    def read(cls, section: Fields) -> FlashSpec:
        """Check and read what a flash LiDAR measures.

        Raises:
            SpecError: names the field and what is wrong with it.
        """
        found: Dict[str, Any] = {
            "columns": section.integer("columns", 1, MOST_BEAMS),
            "rows": section.integer("rows", 1, MOST_BEAMS),
            "samples": section.integer("samples", 1, MOST_SAMPLES),
            "returns": section.text("returns", RETURNS),
        }
        for one in fields(cls):
            if one.name not in found:
                found[one.name] = section.number(one.name, least=0.0)
        return cls(**found)
