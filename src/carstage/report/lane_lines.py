"""The report's pictures of lines on the road."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.lane_lines.town import AREAS
from carstage.report import html
from carstage.report.drawing import RgbColour, data_uri
from carstage.report.labelled_pictures import labelled_pictures

_PICTURE_PX = 640
_HIDDEN: RgbColour = (120, 124, 132)
LINE_COLOURS: dict[str, RgbColour] = {
    "white marking": (64, 196, 255),
    "yellow marking": (255, 196, 0),
    "other marking": (190, 110, 255),
    "boundary": (96, 220, 110),
    "crosswalk": (255, 105, 180),
    "stop_line": (238, 90, 40),
    "painted_object": (0, 235, 215),
    "hidden": _HIDDEN,
}


def line_name(row: Mapping[str, Any]) -> str:
    """Which colour of ``LINE_COLOURS`` a row of ``lane_lines.parquet`` has."""
    if row["kind"] != "marking":
        return str(row["kind"])
    return f"{row['colour'] if row['colour'] in ('white', 'yellow') else 'other'} marking"


def draw_lane_lines(rgb: NDArray[np.uint8], rows: Sequence[Mapping[str, Any]]) -> Image.Image:
    """A camera image with lines and outlines of areas; grey where something stands before.

    Args:
        rgb: ``(H, W, 3)``.
        rows: those of the picture.
    """
    picture = Image.fromarray(rgb)
    draw = ImageDraw.Draw(picture)
    thick = max(1, round(picture.width / 320))
    for row in rows:
        places = list(zip(row["u"], row["v"], strict=True))
        seen = list(row["visible"])
        if row["kind"] in AREAS:
            places, seen = [*places, places[0]], [*seen, seen[0]]
        colour = LINE_COLOURS[line_name(row)]
        for number in range(len(places) - 1):
            hidden = not (seen[number] and seen[number + 1])
            fill = _HIDDEN if hidden else colour
            draw.line([places[number], places[number + 1]], fill=fill, width=1 if hidden else thick)
    return picture


def lane_lines_section(episode: Episode, frames: Sequence[int]) -> str:
    """Labelled cameras' images of some frames with their lines; empty where none were asked for."""
    try:
        table = episode.lane_lines()
    except DatasetError:
        return ""  # the validation reports it
    if table is None:
        return ""
    figures, shown = [], set[str]()
    for place, image, rows in labelled_pictures(episode, frames, table):
        shown |= {line_name(row) for row in rows}
        picture = draw_lane_lines(image, rows)
        figures.append(
            html.figure(data_uri(picture, _PICTURE_PX), f"{place}: {len(rows)} lines and areas")
        )
    if not figures:
        return ""
    legend = [(n, c) for n, c in LINE_COLOURS.items() if n in shown or n == "hidden"]
    return (
        "<h3>Lines on the road</h3>"
        '<p class="soft">From the vector map; grey where something stands before.</p>'
        f'{html.legend(legend)}<div class="grid">{"".join(figures)}</div>'
    )
