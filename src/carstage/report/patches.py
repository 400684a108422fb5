"""The report's pictures of patches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.report import html
from carstage.report.drawing import RgbColour, data_uri
from carstage.report.labelled_pictures import labelled_pictures

_PICTURE_PX = 640
_SEEN: RgbColour = (255, 64, 200)
_HIDDEN: RgbColour = (120, 124, 132)


def draw_patches(rgb: NDArray[np.uint8], rows: Sequence[Mapping[str, Any]]) -> Image.Image:
    """A camera image with the outlines of patches; grey where nothing of one is seen.

    Args:
        rgb: ``(H, W, 3)``.
        rows: those of the picture.
    """
    picture = Image.fromarray(rgb)
    draw = ImageDraw.Draw(picture)
    for row in rows:
        places = list(zip(row["u"], row["v"], strict=True))
        colour = _SEEN if row["visible_share"] > 0.0 else _HIDDEN
        draw.line([*places, places[0]], fill=colour, width=max(1, round(picture.width / 320)))
        words = f"{row['patch']} {100.0 * row['visible_share']:.0f} %"
        top = min(row["v"])
        draw.text((min(row["u"]), top - 12 if top > 14 else max(row["v"])), words, fill=colour)
    return picture


def patches_section(episode: Episode, frames: Sequence[int]) -> str:
    """Labelled cameras' images of some frames with the patches; empty where there are none."""
    try:
        table = episode.patches()
    except DatasetError:
        return ""  # the validation reports it
    if table is None:
        return ""
    figures = []
    for place, image, rows in labelled_pictures(episode, frames, table):
        caption = f"{place}: {len(rows)} patches in view"
        figures.append(html.figure(data_uri(draw_patches(image, rows), _PICTURE_PX), caption))
    if not figures:
        return ""
    shown = all(patch.is_shown for patch in episode.spec.patches)
    words = "Outlines, and the share that is visible."
    return (
        f'<h3>Patches</h3><p class="soft">{words if shown else words + " Boards are plain."}</p>'
        f'<div class="grid">{"".join(figures)}</div>'
    )
