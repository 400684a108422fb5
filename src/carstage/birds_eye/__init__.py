"""Bird's-eye grids around the ego: what lies in each cell, who, how fast, how high, who sees it.

The shapes come from the vector map, the label tables and recorded depth and points; see
docs/formats/birds-eye.md. The same function makes the grids of a recording and checks them.
"""

from carstage.birds_eye.content import BirdsEye, birds_eye_name, pack_birds_eye, unpack_birds_eye
from carstage.birds_eye.drawing import Drawn, draw_birds_eye
from carstage.birds_eye.grid import Grid, GridPose
from carstage.birds_eye.layers import LAYERS, STATIC_LAYERS, layer_bit
from carstage.birds_eye.town import TownShapes
from carstage.birds_eye.visibility import CameraView, Cloud

__all__ = [
    "LAYERS",
    "STATIC_LAYERS",
    "BirdsEye",
    "CameraView",
    "Cloud",
    "Drawn",
    "Grid",
    "GridPose",
    "TownShapes",
    "birds_eye_name",
    "draw_birds_eye",
    "layer_bit",
    "pack_birds_eye",
    "unpack_birds_eye",
]
