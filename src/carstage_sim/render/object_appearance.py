"""What clients changed about the town, as the renderer needs it.

Objects have an appearance of their own, and triangles can be hidden.

A hidden triangle's corners become zero in its leaf block, where the ray caster meets nothing: that
costs a ray nothing, and the hierarchy stays as it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.street_lamps import StreetLamps
from carstage_sim.render.cast import Geometry
from carstage_sim.render.pictures import picture_tables
from carstage_sim.world.town_changes import TownChanges


class ObjectAppearance(NamedTuple):
    """How level objects appear; row = object id, row 0 stands for what is no object.

    Attributes:
        paint: ``(O + 1, 4)`` float32 linear RGB, and 1 where it replaces the surface's colour; 2
            and more is 2 + the row of a picture that does.
        glow: ``(O + 1, 3)`` float32 linear RGB of light that the surface emits.
        lamp: ``(O + 1,)`` int32 street lamp that the object is, -1 for none.
        pictures, texels: see :class:`carstage_sim.render.pictures.PictureTables`; rows are the
            pictures' numbers.
    """

    paint: NDArray[np.float32]
    glow: NDArray[np.float32]
    lamp: NDArray[np.int32]
    pictures: NDArray[np.float32]
    texels: NDArray[np.float32]


def object_appearance(count: int, lamps: StreetLamps, changes: TownChanges) -> ObjectAppearance:
    """The appearance of ``count`` objects."""
    appearance = ObjectAppearance(
        np.zeros((count + 1, 4), np.float32),
        np.zeros((count + 1, 3), np.float32),
        np.full(count + 1, -1, np.int32),
        *picture_tables(changes.placed_pictures),
    )
    for object_id, colour in changes.paint.items():
        appearance.paint[object_id] = (*colour, 1.0)
    for object_id, colour in changes.glow.items():
        appearance.glow[object_id] = colour
    for object_id, row in changes.picture_rows.items():
        appearance.paint[object_id, 3] = 2.0 + row
    appearance.lamp[lamps.object_id] = np.arange(len(lamps), dtype=np.int32)
    appearance.lamp[0] = -1
    return appearance


class HiddenTriangles:
    """Takes triangles of level objects out of a geometry, and puts them back.

    Args:
        geometry: its arrays are changed in place.
        object_id: ``(T,)`` of its triangles.
    """

    def __init__(self, geometry: Geometry, object_id: NDArray[np.uint32]) -> None:
        self._geometry = geometry
        self._object_id = object_id
        self._hidden: frozenset[int] = frozenset()
        self._taken: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]] | None = None

    def hide(self, object_ids: frozenset[int]) -> Geometry:
        """Make exactly these objects absent.

        Returns:
            The geometry: another tuple of the same arrays after a change. Who keeps a copy knows by
            that that it is out of date.
        """
        if object_ids == self._hidden:
            return self._geometry
        corners = self._geometry.corners
        if self._taken is not None:
            block, slot, before = self._taken
            corners[block, :, slot] = before
            self._taken = None
        self._hidden = object_ids
        if object_ids:
            hidden = np.isin(self._object_id, np.fromiter(object_ids, np.uint32, len(object_ids)))
            numbers = self._geometry.numbers
            block, slot = np.nonzero((numbers >= 0) & hidden[numbers])
            self._taken = (block, slot, corners[block, :, slot].copy())
            corners[block, :, slot] = 0.0
        self._geometry = self._geometry._replace()
        return self._geometry
