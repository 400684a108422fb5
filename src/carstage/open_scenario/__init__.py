"""OpenSCENARIO 1.x files, as far as Car-STAGE plays them itself.

``document`` parses what may be hostile and reads attributes, ``places``, ``entities``, ``actions``
and ``conditions`` read parts, ``reading`` puts them together.
"""

from carstage.open_scenario.reading import read_storyboard, town_of

__all__ = ["read_storyboard", "town_of"]
