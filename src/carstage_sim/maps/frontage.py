"""Lines along which things stand: the edges of sidewalks, by distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.strips import WALKED_KINDS, Strip


@dataclass(frozen=True, slots=True)
class Frontage:
    """A sidewalk, with the road on its left.

    Attributes:
        road_id: the road that it runs along.
        kerb, back: ``(N, 2)`` m, its edges to the road and away from it.
        along_m: ``(N,)`` distance along the middle.
        yaw_deg: ``(N,)`` unwrapped direction.
    """

    road_id: int
    kerb: NDArray[np.float64]
    back: NDArray[np.float64]
    along_m: NDArray[np.float64]
    yaw_deg: NDArray[np.float64]

    @property
    def length_m(self) -> float:
        """Length of the middle line."""
        return float(self.along_m[-1])

    def from_kerb(self, station_m: float, away_m: float) -> tuple[float, float, float]:
        """x, y and yaw (deg, looking at the road) of a place that far behind the kerb."""
        return self._place(self.kerb, station_m, away_m)

    def from_back(self, station_m: float, away_m: float) -> tuple[float, float, float]:
        """The same for a place behind the sidewalk; stations may lie a little beyond the ends."""
        return self._place(self.back, station_m, away_m)

    def _place(
        self, line: NDArray[np.float64], station_m: float, away_m: float
    ) -> tuple[float, float, float]:
        inside = min(max(station_m, 0.0), self.length_m)
        yaw = float(np.interp(inside, self.along_m, self.yaw_deg))
        ahead = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw))])
        right = np.array([-ahead[1], ahead[0]])
        foot = np.array([np.interp(inside, self.along_m, line[:, k]) for k in range(2)])
        x, y = foot + ahead * (station_m - inside) + right * away_m
        return float(x), float(y), (yaw - 90.0 + 180.0) % 360.0 - 180.0


def frontages(lanes: list[Strip], *, inside_junctions: bool = False) -> list[Frontage]:
    """All sidewalks outside junctions, or the straight ones inside."""
    result = []
    for lane in lanes:
        if lane.kind not in WALKED_KINDS or (lane.junction_id != -1) != inside_junctions:
            continue
        if inside_junctions and np.ptp(np.unwrap(lane.yaw_deg, period=360.0)) > 1.0:
            continue
        steps = np.linalg.norm(np.diff(lane.center, axis=0), axis=1)
        result.append(
            Frontage(
                lane.road_id,
                lane.offset(-1.0),
                lane.offset(1.0),
                np.concatenate([[0.0], np.cumsum(steps)]),
                np.degrees(np.unwrap(np.radians(lane.yaw_deg))),
            )
        )
    return result
