"""What the depth camera saw: decoded, brought into the world, and how well it fits a pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.decoding import decode_depth_bgra
from carstage.geometry import FloatArray, range_per_depth
from carstage.selftest.evidence import Evidence
from carstage.selftest.verdict import Check
from carstage.selftest.warping import (
    FAR_M,
    Warp,
    agreement,
    in_world,
    inside_box,
    optical_points,
    sampled_pixels,
    warp,
)

GAPS = (1, 2)
"""Ticks between two pictures that are compared."""

LAGS = (0, -1, 1, -2, 2)
"""Ticks by which pictures may be off their poses."""

EXPLAINS = 0.6
"""Share of points that must fit: leaves move in the wind, and edges of fences are thinner than
pixels."""

CLEARLY = 1.5
"""So many times more points must fit than under the next best explanation."""

_MARGIN_M = 0.5
_STRIDE = 3

Decoder = Callable[[NDArray[np.uint8]], FloatArray]


@dataclass(frozen=True, slots=True)
class DepthView:
    """The depth pictures of ``T`` ticks, and the points that ``N`` of their pixels show.

    Attributes:
        evidence: what they were taken from.
        depth_m: ``(T, H, W)`` along the optical axis.
        pixels: ``(N, 2)`` rows and columns of the sampled pixels, the same at each tick.
        optical: ``(T, N, 3)`` what they show, in optical axes.
        points: ``(T, N, 3)`` in the world, by the pose of the snapshot of the same tick.
    """

    evidence: Evidence
    depth_m: FloatArray
    pixels: NDArray[np.int64]
    optical: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, evidence: Evidence, depth_m: FloatArray) -> DepthView:
        """Bring depth pictures into the world."""
        pixels = sampled_pixels(depth_m.shape[1], depth_m.shape[2], _STRIDE)
        optical = np.stack([optical_points(depth, pixels, evidence.k) for depth in depth_m])
        poses = evidence.world_from_camera
        points = [in_world(seen, pose) for seen, pose in zip(optical, poses, strict=True)]
        return cls(evidence, depth_m, pixels, optical, np.stack(points))

    def at(self, picture: NDArray[Any]) -> NDArray[Any]:
        """What a picture ``(H, W, ...)`` holds at the sampled pixels, ``(N, ...)``."""
        return picture[self.pixels[:, 0], self.pixels[:, 1]]

    def warp(self, tick: int, other: int, pose_lag: int = 0) -> Warp:
        """Where what stood still and was seen at ``tick`` lies in the picture of ``other``.

        Args:
            tick: of the first picture.
            other: of the second.
            pose_lag: both pictures are taken as seen from the poses of so many ticks later.
        """
        evidence, here, there = self.evidence, tick + pose_lag, other + pose_lag
        points = self.points[tick]
        if pose_lag:
            points = in_world(self.optical[tick], evidence.world_from_camera[here])
        still = self.optical[tick, :, 2] < FAR_M
        for body in evidence.bodies:
            for moment in (here, there):
                box = body.world_from_box[moment]
                still &= ~inside_box(points, box, body.extent, _MARGIN_M)
        height, width = self.depth_m.shape[1:]
        pose = evidence.world_from_camera[there]
        return warp(self.pixels[still], points[still], pose, evidence.k, (height, width))

    def fit(self, pose_lag: int = 0) -> float:
        """Share of points that pictures of different ticks agree on, at a lag of the poses."""
        return float(
            np.mean(
                [
                    agreement(self.warp(tick, other, pose_lag), self.depth_m[other])
                    for tick, other in pairs(self.evidence.ticks, pose_lag)
                ]
            )
        )


def pairs(ticks: int, lag: int) -> list[tuple[int, int]]:
    """Ticks to compare that are there at a lag, too."""
    return [
        (tick, tick + gap)
        for gap in GAPS
        for tick in range(max(0, -lag), ticks - gap - max(0, lag))
    ]


def _along_axis(image_bgra: NDArray[np.uint8]) -> FloatArray:
    return decode_depth_bgra(image_bgra).astype(np.float64)


def _along_ray(image_bgra: NDArray[np.uint8], factor: FloatArray) -> FloatArray:
    return _along_axis(image_bgra) / factor


def _reversed(image_bgra: NDArray[np.uint8]) -> FloatArray:
    return _along_axis(image_bgra[..., [2, 1, 0, 3]])


DEPTH_CODE = "R + 256 G + 65536 B, along the optical axis"


def check_depth(evidence: Evidence) -> tuple[Check, DepthView]:
    """Which code explains the depth pictures; and what is seen when they are read by it.

    Pictures of different ticks show the same surfaces. Their known poses fix the scale, so that the
    right code makes them agree and wrong ones do not, whatever tick the poses really belong to.
    """
    pictures = evidence.pictures["depth"]
    height, width = pictures.shape[1:3]
    fov_deg = float(evidence.records["depth"][0].meta["fov_deg"])
    factor = range_per_depth(width, height, fov_deg)
    decoders: dict[str, Decoder] = {
        DEPTH_CODE: _along_axis,
        "R + 256 G + 65536 B, along the ray": lambda image: _along_ray(image, factor),
        "B + 256 G + 65536 R, along the optical axis": _reversed,
    }
    best: tuple[float, str, DepthView] | None = None
    for name, decode in decoders.items():
        view = DepthView.of(evidence, np.stack([decode(picture) for picture in pictures]))
        share = max(view.fit(lag) for lag in LAGS[:3])
        if best is None or share > best[0]:
            best = (share, name, view)
        if share >= EXPLAINS:
            break  # the others explain less: no need to try
    assert best is not None
    share, name, view = best
    if share < EXPLAINS:
        view = DepthView.of(evidence, np.stack([_along_axis(picture) for picture in pictures]))
        return Check("depth code", False, "no code that is known", DEPTH_CODE, share), view
    return Check("depth code", name == DEPTH_CODE, name, DEPTH_CODE, share), view
