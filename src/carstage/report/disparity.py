"""The report's pictures of disparity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.report import html
from carstage.report.drawing import data_uri

_PICTURE_PX = 640
_COLOURS = np.array(
    [[24, 16, 66], [34, 94, 168], [52, 168, 140], [180, 206, 80], [252, 190, 60], [216, 60, 50]],
    np.float64,
)
_NONE = (18, 18, 22)


def draw_disparity(disparity_px: NDArray[np.float32]) -> Image.Image:
    """Disparity as colours, far blue to near red, by its logarithm; dark where there is none.

    Args:
        disparity_px: ``(H, W)``, NaN for none.
    """
    known = np.isfinite(disparity_px)
    picture = np.empty((*disparity_px.shape, 3), np.float64)
    picture[:] = _NONE
    if known.any():
        height = np.log(disparity_px[known].astype(np.float64))
        low, high = np.quantile(height, (0.01, 0.99))
        share = np.clip((height - low) / max(high - low, 1e-9), 0.0, 1.0)
        stops = np.linspace(0.0, 1.0, len(_COLOURS))
        picture[known] = np.stack([np.interp(share, stops, c) for c in _COLOURS.T], axis=-1)
    return Image.fromarray(picture.astype(np.uint8))


def disparity_section(episode: Episode, frames: Sequence[int]) -> str:
    """The left pictures' disparity of some frames; empty where none was asked for."""
    if not episode.spec.labels.disparity:
        return ""
    figures = []
    for pair in episode.stereo_pairs():
        for k in frames:
            try:
                found = episode.disparity(pair.left.id, k)
            except DatasetError:
                continue  # the validation reports it
            if found is None:
                continue
            largest = np.nanmax(found) if np.isfinite(found).any() else 0.0
            caption = f"{pair.left.id} and {pair.right.id}, frame {k}: up to {largest:.1f} px"
            figures.append(html.figure(data_uri(draw_disparity(found), _PICTURE_PX), caption))
    if not figures:
        return ""
    return (
        '<h3>Disparity</h3><p class="soft">Far is blue, near is red; dark: none.</p>'
        f'<div class="grid">{"".join(figures)}</div>'
    )
