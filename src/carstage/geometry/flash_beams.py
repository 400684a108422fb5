"""Where the beams of a flash LiDAR look, and what has to be recorded for them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Protocol

import numpy as np

from carstage.geometry.coordinates import FloatArray
from carstage.geometry.lens_sources import WIDEST_DEG, SourceView, view_of_rays

STEEPEST = 1e-3
"""Cosine of incidence that surfaces seen edge-on are taken to have."""


class BeamArray(Protocol):
    """Where beams look and how wide they are; ``carstage.spec.FlashSpec`` is one."""

    @property
    def columns(self) -> int:
        """Beams side by side, in equal steps of azimuth."""

    @property
    def rows(self) -> int:
        """Beams one above the other, in equal steps of elevation."""

    @property
    def horizontal_fov_deg(self) -> float:
        """What the columns span, half a step beyond the outer ones."""

    @property
    def vertical_fov_deg(self) -> float:
        """What the rows span, likewise."""

    @property
    def horizontal_divergence_deg(self) -> float:
        """Full angle of a beam; 0: a line."""

    @property
    def vertical_divergence_deg(self) -> float:
        """Full angle of a beam; 0: a line."""

    @property
    def samples(self) -> int:
        """Depths to either side of a beam's footprint."""


def beam_angles(flash: BeamArray) -> tuple[FloatArray, FloatArray]:
    """Azimuths ``(columns,)``, from left to right, and elevations ``(rows,)``, from the top, rad.

    Axes are those of a CARLA sensor: azimuth 0 is ahead, positive to the right.
    """
    across, up = math.radians(flash.horizontal_fov_deg), math.radians(flash.vertical_fov_deg)
    azimuth = ((np.arange(flash.columns) + 0.5) / flash.columns - 0.5) * across
    elevation = (0.5 - (np.arange(flash.rows) + 0.5) / flash.rows) * up
    return azimuth, elevation


def beam_directions(flash: BeamArray) -> FloatArray:
    """``(rows * columns, 3)`` unit vectors in CARLA's sensor axes, row by row from the top left."""
    azimuth, elevation = beam_angles(flash)
    return _on_sphere(azimuth[None, :], elevation[:, None]).reshape(-1, 3)


def footprint_rays(flash: BeamArray) -> FloatArray:
    """``(rows * columns, samples ** 2, 3)`` unit vectors in optical axes, x right, y down, z ahead.

    A footprint is a rectangle of angles, as a pixel of a receiver sees it, sampled at the middles
    of equal cells.
    """
    azimuth, elevation = beam_angles(flash)
    cells = (np.arange(flash.samples) + 0.5) / flash.samples - 0.5
    to_right = cells * math.radians(flash.horizontal_divergence_deg)
    upward = cells * math.radians(flash.vertical_divergence_deg)
    across = azimuth[None, :, None, None] + to_right[None, None, None, :]
    up = elevation[:, None, None, None] - upward[None, None, :, None]
    carla = _on_sphere(across, up).reshape(flash.rows * flash.columns, flash.samples**2, 3)
    return np.stack([carla[..., 1], -carla[..., 2], carla[..., 0]], axis=-1)


def _on_sphere(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    """Unit vectors x forward, y right, z up, by functions of ``math``: the same bits everywhere."""
    cos_up, sin_up = _COS(elevation), _SIN(elevation)
    parts = cos_up * _COS(azimuth), cos_up * _SIN(azimuth), sin_up
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


_SIN = np.vectorize(math.sin, otypes=[np.float64])
_COS = np.vectorize(math.cos, otypes=[np.float64])


@lru_cache(maxsize=64)
def flash_source(flash: BeamArray, oversampling: float) -> SourceView:
    """The depth picture, or the cube's faces, that a flash LiDAR is made from.

    Args:
        flash: what it measures.
        oversampling: recorded pixels per sample of a footprint, ahead.

    Raises:
        BadInputError: too large pictures would have to be recorded.
    """
    rays = footprint_rays(flash).reshape(-1, 3)
    widest = math.radians(WIDEST_DEG)
    beyond = bool((np.abs(rays[:, :2]) > math.tan(widest) * rays[:, 2:]).any())
    return view_of_rays(rays, sample_step_rad(flash), cube=beyond, oversampling=oversampling)


def sample_step_rad(flash: BeamArray) -> float:
    """The smaller angle between samples next to each other, of a footprint or of two."""
    steps = []
    for fov_deg, count, divergence_deg in (
        (flash.horizontal_fov_deg, flash.columns, flash.horizontal_divergence_deg),
        (flash.vertical_fov_deg, flash.rows, flash.vertical_divergence_deg),
    ):
        steps.append(fov_deg / count)
        if flash.samples > 1 and divergence_deg > 0.0:
            steps.append(divergence_deg / flash.samples)
    return math.radians(min(steps))
