"""What the traffic check watches: standing, gaps between vehicles, walkers hit, lights passed."""

from __future__ import annotations

import carla
import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.overlap import footprint_corners

STANDING_SPEED = 0.1  # m/s
QUEUE_GAP_M = 12.0
TOUCHING_GAP_M = 0.05
"""The server pushes overlapping vehicles apart, so a collision shows as a gap of nothing."""
HIT_SPEED = 0.5  # m/s; a walker may well walk into a car that stands

FloatArray = NDArray[np.float64]


def gap_m(
    center_a: FloatArray,
    extent_a: FloatArray,
    yaw_a_deg: float,
    center_b: FloatArray,
    extent_b: FloatArray,
    yaw_b_deg: float,
) -> float:
    """Widest gap between two footprints along any of their axes; negative when they overlap.

    Of separate boxes it is at most their distance, of overlapping ones minus the least way out.

    Args:
        center_a, extent_a: ``(2 or 3,)`` centre and half sizes, metres.
        yaw_a_deg: heading of the box.
    """
    one = footprint_corners(center_a, extent_a, np.asarray(yaw_a_deg))
    other = footprint_corners(center_b, extent_b, np.asarray(yaw_b_deg))
    widest = -np.inf
    for yaw_deg in (yaw_a_deg, yaw_a_deg + 90.0, yaw_b_deg, yaw_b_deg + 90.0):
        axis = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
        a, b = one @ axis, other @ axis
        widest = max(widest, b.min() - a.max(), a.min() - b.max())
    return float(widest)


class TrafficMonitor:
    """Watches samples of all vehicles and keeps the figures.

    Args:
        box_center, box_extent: ``(N, 3)`` bounding boxes in the vehicles' frames.
        names: what to call each vehicle in events.
    """

    def __init__(self, box_center: FloatArray, box_extent: FloatArray, names: list[str]) -> None:
        self._center, self._extent, self._names = box_center, box_extent, names
        self.standing_s = np.zeros(len(names))
        self.longest_stand_s = np.zeros(len(names))
        self.distance_m = np.zeros(len(names))
        self.touching: dict[tuple[int, int], float] = {}
        self.narrowest_gap_m = 10.0
        self.hit: set[int] = set()
        self._last_location: FloatArray | None = None

    def sample(
        self,
        elapsed_s: float,
        location: FloatArray,
        yaw_deg: FloatArray,
        speed: FloatArray,
        held_by_light: NDArray[np.bool_],
    ) -> None:
        """Takes one sample; a row of NaN is a vehicle that is gone.

        Args:
            elapsed_s: time since the last sample.
            location: ``(N, 3)``; yaw_deg, speed: ``(N,)``.
            held_by_light: ``(N,)`` whether a light that is not green holds the vehicle.
        """
        if self._last_location is not None:
            self.distance_m += np.nan_to_num(np.linalg.norm(location - self._last_location, axis=1))
        self._last_location = location
        standing = speed < STANDING_SPEED
        queued = self._queued(location, yaw_deg, standing, held_by_light)
        self.standing_s = np.where(
            standing & ~queued, self.standing_s + elapsed_s, np.where(standing, self.standing_s, 0)
        )
        self.longest_stand_s = np.maximum(self.longest_stand_s, self.standing_s)
        self._find_gaps(location, yaw_deg)

    def sample_walkers(
        self, walkers: FloatArray, location: FloatArray, yaw_deg: FloatArray, speed: FloatArray
    ) -> None:
        """Notes walkers, ``(W, 2)``, whose middle is inside the footprint of a moving vehicle."""
        yaw = np.radians(yaw_deg)
        offset = walkers[:, None, :] - location[None, :, :2]
        ahead = offset[..., 0] * np.cos(yaw) + offset[..., 1] * np.sin(yaw) - self._center[:, 0]
        aside = offset[..., 1] * np.cos(yaw) - offset[..., 0] * np.sin(yaw)
        inside = (np.abs(ahead) < self._extent[:, 0]) & (np.abs(aside) < self._extent[:, 1])
        self.hit.update(np.flatnonzero((inside & (speed > HIT_SPEED)).any(axis=1)).tolist())

    def _queued(
        self,
        location: FloatArray,
        yaw_deg: FloatArray,
        standing: NDArray[np.bool_],
        held: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Who stands at a light, or behind one who does."""
        yaw = np.radians(yaw_deg)
        forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        offset = location[None, :, :2] - location[:, None, :2]
        ahead = np.einsum("ijk,ik->ij", offset, forward)
        aside = np.abs(offset[..., 1] * forward[:, None, 0] - offset[..., 0] * forward[:, None, 1])
        gap = ahead - self._extent[:, None, 0] - self._extent[None, :, 0]
        follows = (ahead > 0.0) & (gap < QUEUE_GAP_M) & (aside < 2.5)
        queued: NDArray[np.bool_] = standing & held
        for _ in range(len(self._names)):
            grown = queued | (standing & (follows & queued[None, :]).any(axis=1))
            if (grown == queued).all():
                break
            queued = grown
        return queued

    def _find_gaps(self, location: FloatArray, yaw_deg: FloatArray) -> None:
        yaw = np.radians(yaw_deg)
        forward = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
        center = location + self._center[:, 0:1] * forward
        reach = np.linalg.norm(self._extent[:, :2], axis=1)
        distance = np.linalg.norm(center[:, None, :2] - center[None, :, :2], axis=-1)
        near = np.triu(distance < reach[:, None] + reach[None, :], k=1)
        for i, j in np.argwhere(near):
            gap = gap_m(
                center[i], self._extent[i], yaw_deg[i], center[j], self._extent[j], yaw_deg[j]
            )
            self.narrowest_gap_m = min(self.narrowest_gap_m, gap)
            if gap < TOUCHING_GAP_M:
                pair = (int(i), int(j))
                self.touching[pair] = min(self.touching.get(pair, gap), gap)


class LightMonitor:
    """Watches, tick by tick, under which state vehicles leave the trigger volumes of lights."""

    def __init__(self) -> None:
        self.passed = 0
        self.red_run = 0
        self._before: dict[int, carla.TrafficLightState | None] = {}

    def sample(self, actor: carla.Vehicle) -> None:
        """Takes one vehicle's state in the current frame."""
        state = actor.get_traffic_light_state() if actor.is_at_traffic_light() else None
        before = self._before.get(actor.id)
        self._before[actor.id] = state
        if before is not None and state is None and actor.is_alive:
            self.passed += 1
            moving = actor.get_velocity().length() > STANDING_SPEED
            self.red_run += before == carla.TrafficLightState.Red and moving
