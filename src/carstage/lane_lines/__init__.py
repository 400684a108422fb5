"""Lane markings, crosswalks and stop lines in pictures: from the vector map, cut by depth.

``TownLines`` prepares a town, ``lines_in_view`` gives the rows of one picture; see
docs/formats/lane-lines.md.
"""

from carstage.lane_lines.projection import PictureView, lines_in_view
from carstage.lane_lines.town import TownLine, TownLines

__all__ = ["PictureView", "TownLine", "TownLines", "lines_in_view"]
