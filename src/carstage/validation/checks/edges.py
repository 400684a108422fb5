"""The colour image shows what the labels say: its edges lie where objects end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.validation.checks.findings import Findings

MIN_RATIO = 1.1
MIN_BOUNDARY_PIXELS = 500
MIN_CONTRAST = 5.0
MIN_FIT = 0.9
MIN_MIRROR_PIXELS = 200
MORE_IN_THE_MIRROR = 1.25
WINDOW = 5
"""So many frames in a row that fit their neighbours' labels better are reported."""
MIN_WINDOW_PIXELS = 200
MIN_DEVIATIONS = 3.0
"""Of the difference between the two means: chance must not explain it."""
_SHIFT_SHARE = 8


@dataclass(slots=True)
class EdgeFigures:
    """Sums over images: steps of brightness (0 to 255) at boundaries of labels and next to them.

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


def steepness(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Steps of brightness (0 to 255) between horizontal neighbours, ``(H, W - 1)``.

    The steepest of three: anti-aliasing spreads an edge over its neighbours.
    """
    step = np.abs(np.diff(_brightness(rgb), axis=1))
    steepest = step.copy()
    np.maximum(steepest[:, 1:], step[:, :-1], out=steepest[:, 1:])
    np.maximum(steepest[:, :-1], step[:, 1:], out=steepest[:, :-1])
    return steepest.astype(np.float32) / np.float32(3.0)


def boundaries(labels: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Where ``(H, W)`` labels change from one pixel to the next, ``(H, W - 1)``."""
    return np.asarray(labels[:, 1:] != labels[:, :-1])


def compare_edges(
    rgb: NDArray[np.uint8], steep: NDArray[np.float32], boundary: NDArray[np.bool_]
) -> EdgeFigures:
    """Steps of brightness between horizontal neighbours, where labels change and elsewhere.

    *Elsewhere* is the same set of pixels, moved sideways by an eighth of the image: so both have
    the same heights in the picture, and only the right camera and frame has more on the first.

    Args:
        rgb: ``(H, W, 3)``.
        steep: its ``steepness``.
        boundary: ``boundaries`` of the labels of the same frame.
    """
    row, column = _pixels(boundary)
    figures = EdgeFigures(
        at_boundary=float(steep[row, column].sum()),
        boundary_pixels=len(row),
        contrast=_deviation(_brightness(rgb)) / 3.0,
        images=1,
    )
    near = _grown(boundary)
    shift = max(1, rgb.shape[1] // _SHIFT_SHARE)
    for beside in (column - shift, column + shift):
        inside = (beside >= 0) & (beside < boundary.shape[1])
        place = row[inside], beside[inside]
        chosen = steep[place][~near[place]]
        figures.beside += float(chosen.sum())
        figures.beside_pixels += len(chosen)
    return figures


def _pixels(chosen: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of what is true: few pixels, so faster than masks of whole images."""
    row, column = np.divmod(np.flatnonzero(chosen), max(chosen.shape[1], 1))
    return row, column


def _deviation(brightness: NDArray[np.int16]) -> float:
    """Standard deviation, by how often each value occurs."""
    counts = np.bincount(brightness.ravel(), minlength=1)
    values = np.arange(len(counts))
    mean = np.average(values, weights=counts)
    return float(np.sqrt(np.average((values - mean) ** 2, weights=counts)))


def _brightness(rgb: NDArray[np.uint8]) -> NDArray[np.int16]:
    red, green, blue = (rgb[..., channel].astype(np.int16) for channel in range(3))
    return red + green + blue  # planes: three times as fast as a sum over the last axis


def _grown(boundary: NDArray[np.bool_]) -> NDArray[np.bool_]:
    grown = boundary.copy()
    grown[:, 1:] |= boundary[:, :-1]
    grown[:, :-1] |= boundary[:, 1:]
    return grown


def check_mirrored(
    camera_id: str,
    k: int,
    steep: NDArray[np.float32],
    boundary: NDArray[np.bool_],
    findings: Findings,
) -> None:
    """Report a picture that fits its labels better as its own mirror image (check ``mirrored``).

    Args:
        camera_id: the camera.
        k: the frame.
        steep: ``steepness`` of its picture.
        boundary: ``boundaries`` of the labels of the same frame.
        findings: where problems go.
    """
    row, column = _pixels(boundary)
    if len(row) < MIN_MIRROR_PIXELS:
        return
    own = float(steep[row, column].mean())
    mirrored = float(steep[row, boundary.shape[1] - 1 - column].mean())
    if mirrored > MORE_IN_THE_MIRROR * max(own, 1e-3) and mirrored > MIN_CONTRAST:
        findings.add(
            "mirrored",
            "the picture is mirrored: where labels change, its mirror image is "
            f"{mirrored / max(own, 1e-3):.2f} times as steep",
            frame=k,
            sensor=camera_id,
        )


@dataclass(slots=True)
class FrameFit:
    """How images fit the labels of a neighbouring frame instead of their own.

    Sums of steepness, of its squares, and pixels: ``own`` where only the frame's own labels
    change, ``other`` where only the neighbour's do.
    """

    own: float = 0.0
    own_squares: float = 0.0
    own_pixels: int = 0
    other: float = 0.0
    other_squares: float = 0.0
    other_pixels: int = 0

    def add(self, other: FrameFit) -> None:
        """Add the sums of other images."""
        self.own += other.own
        self.own_squares += other.own_squares
        self.own_pixels += other.own_pixels
        self.other += other.other
        self.other_squares += other.other_squares
        self.other_pixels += other.other_pixels

    def add_image(
        self,
        steep: NDArray[np.float32],
        own: NDArray[np.bool_],
        other: NDArray[np.bool_],
    ) -> None:
        """Count an image by the boundaries of its own frame and of the neighbour."""
        only_own, only_other = (
            np.flatnonzero(a & ~_grown(b)) for a, b in ((own, other), (other, own))
        )
        here, there = (steep.ravel()[only].astype(np.float64) for only in (only_own, only_other))
        self.own += float(here.sum())
        self.own_squares += float(here @ here)
        self.own_pixels += len(here)
        self.other += float(there.sum())
        self.other_squares += float(there @ there)
        self.other_pixels += len(there)

    @property
    def ratio(self) -> float | None:
        """Own over the neighbour's; ``None`` where the two frames hardly differ."""
        return self.ratio_from(MIN_BOUNDARY_PIXELS)

    def ratio_from(self, pixels: int) -> float | None:
        """The ratio; ``None`` with fewer pixels than that."""
        if min(self.own_pixels, self.other_pixels) < pixels:
            return None
        return (self.own / self.own_pixels) / max(self.other / self.other_pixels, 1e-3)

    @property
    def deviations(self) -> float:
        """By how many standard deviations the mean at the neighbour's boundaries is the larger."""
        own, other = self.own / self.own_pixels, self.other / self.other_pixels
        spread = (self.own_squares / self.own_pixels - own**2) / self.own_pixels
        spread += (self.other_squares / self.other_pixels - other**2) / self.other_pixels
        return (other - own) / math.sqrt(max(spread, 1e-12))

    @property
    def rounded(self) -> float | None:
        """The ratio for the report."""
        return None if self.ratio is None else round(self.ratio, 3)


def new_fits() -> dict[int, FrameFit]:
    """Sums for the frame before (-1) and the frame after (1)."""
    return {-1: FrameFit(), 1: FrameFit()}


def check_frame_fit(camera_id: str, fits: Mapping[int, FrameFit], findings: Findings) -> None:
    """Report a camera whose images fit the labels of other frames better (check ``rgb_frame``).

    Where the labels of two neighbouring frames differ, an image must be steeper where its own
    change than where the neighbour's do.

    Args:
        camera_id: the camera.
        fits: by -1 (the frame before) and 1 (the frame after).
        findings: where problems go.
    """
    for step, fit in sorted(fits.items()):
        if fit.ratio is not None and fit.ratio < MIN_FIT and fit.deviations >= MIN_DEVIATIONS:
            findings.add(
                "rgb_frame",
                f"the images show the frame {'after' if step > 0 else 'before'}: where its labels "
                f"change they are {1.0 / max(fit.ratio, 1e-3):.2f} times as steep as where "
                "those of their own frame do",
                sensor=camera_id,
            )


def check_windows(camera_id: str, fits: Sequence[tuple[int, FrameFit]], findings: Findings) -> None:
    """Report frames in a row that show the frame before (check ``rgb_frame``).

    Args:
        camera_id: the camera.
        fits: frame, and how it fits the labels of the frame before, in order.
        findings: where problems go.
    """
    for begin in range(len(fits) - WINDOW + 1):
        window = fits[begin : begin + WINDOW]
        total = FrameFit()
        for _, fit in window:
            total.add(fit)
        ratio = total.ratio_from(MIN_WINDOW_PIXELS)
        if ratio is None or ratio >= MIN_FIT:
            continue
        if total.deviations >= MIN_DEVIATIONS:
            findings.add(
                "rgb_frame",
                f"the images of frames {window[0][0]} to {window[-1][0]} show the frame before",
                frame=window[0][0],
                sensor=camera_id,
            )
            return


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
