"""The colour image shows what the labels say: its edges lie where objects end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.checks.findings import Findings

MIN_RATIO = 1.1
MIN_BOUNDARY_PIXELS = 500
MIN_CONTRAST = 5.0
_SHIFT_SHARE = 8


@dataclass(slots=True)
class EdgeFigures:
    """Sums over images: steps of brightness (0 to 255) at boundaries of labels and beside them.

    ``contrast`` sums the standard deviation of each image's brightness.
    """

    at_boundary: float = 0.0
    beside: float = 0.0
    boundary_pixels: int = 0
    beside_pixels: int = 0
    contrast: float = 0.0
    images: int = 0

    def add(self, other: EdgeFigures) -> None:
        """Add the counts of another image."""
        self.at_boundary += other.at_boundary
        self.beside += other.beside
        self.boundary_pixels += other.boundary_pixels
        self.beside_pixels += other.beside_pixels
        self.contrast += other.contrast
        self.images += other.images

    @property
    def ratio(self) -> float | None:
        """How much steeper the image is at boundaries; ``None`` where too little can be seen."""
        if self.boundary_pixels < MIN_BOUNDARY_PIXELS or not self.beside_pixels:
            return None
        if self.contrast / self.images < MIN_CONTRAST:
            return None
        at, beside = self.at_boundary / self.boundary_pixels, self.beside / self.beside_pixels
        return at / max(beside, 1e-3)


def compare_edges(rgb: NDArray[np.uint8], labels: NDArray[np.generic]) -> EdgeFigures:
    """Steps of brightness between horizontal neighbours, where labels change and elsewhere.

    *Elsewhere* is the same set of pixels, moved sideways by an eighth of the image: so both have
    the same heights in the picture, and only the right camera and frame has more on the first.

    Args:
        rgb: ``(H, W, 3)``.
        labels: ``(H, W)`` any numbers that differ between things.
    """
    red, green, blue = (rgb[..., channel].astype(np.int16) for channel in range(3))
    brightness = red + green + blue  # planes: three times as fast as a sum over the last axis
    step = np.abs(np.diff(brightness, axis=1)).astype(np.float32) / np.float32(3.0)
    steepest = step.copy()  # anti-aliasing spreads an edge over its neighbours
    steepest[:, 1:] = np.maximum(steepest[:, 1:], step[:, :-1])
    steepest[:, :-1] = np.maximum(steepest[:, :-1], step[:, 1:])
    boundary = labels[:, 1:] != labels[:, :-1]
    near = boundary.copy()
    near[:, 1:] |= boundary[:, :-1]
    near[:, :-1] |= boundary[:, 1:]
    figures = EdgeFigures(
        at_boundary=float(steepest[boundary].sum()),
        boundary_pixels=int(boundary.sum()),
        contrast=float(brightness.std()) / 3.0,
        images=1,
    )
    shift = max(1, rgb.shape[1] // _SHIFT_SHARE)
    for beside, place in (
        (boundary[:, shift:], np.s_[:, :-shift]),
        (boundary[:, :-shift], np.s_[:, shift:]),
    ):
        chosen = beside & ~near[place]
        figures.beside += float(steepest[place][chosen].sum())
        figures.beside_pixels += int(chosen.sum())
    return figures


def check_edges(camera_id: str, figures: EdgeFigures, findings: Findings) -> None:
    """Report a camera whose image has no edges where its labels have (check ``rgb_edges``).

    It finds images of another camera or a mirrored image. Dark or empty images say nothing and
    pass.
    """
    ratio = figures.ratio
    if ratio is not None and ratio < MIN_RATIO:
        findings.add(
            "rgb_edges",
            f"the images do not show what the labels say: at the boundaries of objects they are "
            f"{ratio:.2f} times as steep as beside them; at least {MIN_RATIO} is expected",
            sensor=camera_id,
        )
