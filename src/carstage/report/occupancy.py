"""The report's pictures of voxels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.occupancy import FREE, Occupancy
from carstage.report import html
from carstage.report.drawing import RgbColour, data_uri
from carstage.tags import TAGS_0_9_14

_BACKGROUND: RgbColour = (16, 18, 24)
_WIDTH_PX: Final = 960
_UNSEEN_SHARE: Final = 0.45
_SIDE_SHARE: Final = 0.7
"""How bright the side of a voxel is beside its top."""


def occupancy_picture(content: Occupancy) -> Image.Image:
    """Voxels from behind and above, forward up; dark where no sensor of this frame sees them."""
    rows, columns, layers = content.grid.shape
    px = max(2, _WIDTH_PX // columns)
    rise = max(1, px * 3 // 4)
    picture: NDArray[np.uint8] = np.empty((rows * px + layers * rise, columns * px, 3), np.uint8)
    picture[:] = _BACKGROUND
    top = _colours(content)
    side = (top * _SIDE_SHARE).astype(np.uint8)
    # From far to near and from below: what is painted later hides what it should.
    for row in range(rows - 1, -1, -1):
        for layer in np.flatnonzero((content.semantic[row] != FREE).any(axis=0)).tolist():
            there = (content.semantic[row, ::-1, layer] != FREE).repeat(px)
            down = (rows - 1 - row) * px + (layers - 1 - layer) * rise
            for colours, first, last in (
                (top, down, down + px),
                (side, down + px, down + px + rise),
            ):
                strip = colours[row, ::-1, layer].repeat(px, axis=0)
                picture[first:last, there] = strip[there]
    return Image.fromarray(picture)


def _colours(content: Occupancy) -> NDArray[np.uint8]:
    """``(X, Y, Z, 3)`` of the tops."""
    palette = np.zeros((256, 3), np.float64)
    for tag, known in TAGS_0_9_14.items():
        palette[tag] = known.rgb
    layers = content.grid.shape[2]
    light = np.linspace(0.75, 1.0, layers)[None, None, :] * np.where(
        content.seen > 0, 1.0, _UNSEEN_SHARE
    )
    return (palette[content.semantic] * light[..., None]).astype(np.uint8)


def occupancy_section(episode: Episode, frames: Sequence[int]) -> str:
    """The voxels of some frames with a legend; empty where none were asked for."""
    figures, shown = [], set[int]()
    for k in frames:
        try:
            content = episode.occupancy(k)
        except DatasetError:
            continue  # the validation reports it
        if content is None:
            return ""
        shown |= set(np.unique(content.semantic).tolist()) - {FREE}
        caption = (
            f"frame {k}: {int(content.occupied.sum())} voxels of {content.grid.side_m:g} m, "
            f"{len(content.voxels.track_id)} road users"
        )
        picture = occupancy_picture(content)
        figures.append(html.figure(data_uri(picture, picture.width, lossless=True), caption))
    if not figures:
        return ""
    colours = [(TAGS_0_9_14[tag].name, TAGS_0_9_14[tag].rgb) for tag in sorted(shown)]
    return (
        "<h3>Occupancy</h3>"
        '<p class="soft">From behind and above. What no sensor of the frame sees is dark.</p>'
        f'{html.legend(colours)}<div class="grid wide">{"".join(figures)}</div>'
    )
