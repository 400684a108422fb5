"""The report's pictures of bird's-eye grids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image

from carstage.birds_eye import BirdsEye
from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.report import html
from carstage.report.drawing import RgbColour, class_colour, data_uri

_LEAST_PX = 640
_UNSEEN_SHARE = 0.45
_BACKGROUND: RgbColour = (16, 18, 24)
LAYER_COLOURS: dict[str, RgbColour] = {
    "drivable_area": (86, 90, 100),
    "junction": (104, 98, 118),
    "parking": (70, 92, 112),
    "shoulder": (72, 74, 78),
    "bike_lane": (120, 80, 72),
    "sidewalk": (126, 118, 96),
    "crosswalk": (150, 176, 196),
    "curb": (58, 52, 46),
    "broken_marking": (196, 198, 204),
    "solid_marking": (244, 244, 246),
    "stop_line": (238, 120, 60),
    "ego": (255, 255, 255),
    "car": class_colour("car"),
    "van": class_colour("van"),
    "truck": class_colour("truck"),
    "bus": class_colour("bus"),
    "train": class_colour("train"),
    "motorcycle": class_colour("motorcycle"),
    "bicycle": class_colour("bicycle"),
    "pedestrian": class_colour("walker_adult"),
}
"""What is painted over what, from the ground up."""


def birds_eye_picture(content: BirdsEye) -> Image.Image:
    """The layers of a frame, forward up; dimmed where neither camera nor LiDAR sees."""
    picture = np.empty((*content.grid.shape, 3), np.float64)
    picture[:] = _BACKGROUND
    for name, colour in LAYER_COLOURS.items():
        picture[content.layer(name)] = colour
    unseen = ~(content.visible_by_camera | content.visible_by_lidar)
    picture[unseen] = picture[unseen] * _UNSEEN_SHARE
    drawn = Image.fromarray(picture.astype(np.uint8))
    times = max(1, -(-_LEAST_PX // drawn.width))
    return drawn.resize((drawn.width * times, drawn.height * times), Image.Resampling.NEAREST)


def birds_eye_section(episode: Episode, frames: Sequence[int]) -> str:
    """The grids of some frames with a legend; empty where none were asked for."""
    figures, shown = [], set[str]()
    for k in frames:
        try:
            content = episode.birds_eye(k)
        except DatasetError:
            continue  # the validation reports it
        if content is None:
            return ""
        shown |= {name for name in LAYER_COLOURS if content.layer(name).any()}
        size = f"{content.grid.length_m:g} m by {content.grid.width_m:g} m"
        caption = f"frame {k}: {size}, {len(content.drawn.track_id)} objects"
        picture = birds_eye_picture(content)
        figures.append(html.figure(data_uri(picture, picture.width, lossless=True), caption))
    if not figures:
        return ""
    colours = [(name, LAYER_COLOURS[name]) for name in LAYER_COLOURS if name in shown]
    return (
        "<h3>Bird's-eye grids</h3>"
        '<p class="soft">Forward is up. Cells that neither a camera nor a LiDAR sees are dark.</p>'
        f'{html.legend(colours)}<div class="grid wide">{"".join(figures)}</div>'
    )
