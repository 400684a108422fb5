"""What clients changed about the town, as one frame shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.pictures import PlacedPicture
from carstage_sim.world.street_lights import StreetLights
from carstage_sim.world.town_objects import Colour, TownObjects


@dataclass(frozen=True, slots=True, eq=False)
class TownChanges:
    """What the renderer needs of it; the very same object as long as nothing changes.

    Attributes:
        hidden: ids of level objects that are not there.
        paint: surface colour (linear RGB) of objects, by id.
        glow: emitted light (linear RGB) of objects, by id.
        placed_pictures: all pictures on objects and props.
        picture_rows: which of them an object shows, by its id.
        prop_pictures: which of them a prop shows, by its actor id.
        lamp_power: ``(L, 3)`` float32 light of each street lamp, linear RGB.
    """

    hidden: frozenset[int] = frozenset()
    paint: Mapping[int, Colour] = field(default_factory=dict)
    glow: Mapping[int, Colour] = field(default_factory=dict)
    placed_pictures: tuple[PlacedPicture, ...] = ()
    picture_rows: Mapping[int, int] = field(default_factory=dict)
    prop_pictures: Mapping[int, int] = field(default_factory=dict)
    lamp_power: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 3), np.float32))


class TownChangeTracker:
    """Gives the changes that the current frame shows; a new object only after a change."""

    def __init__(self, objects: TownObjects, lights: StreetLights) -> None:
        self._objects = objects
        self._lights = lights
        self._version = (-1, -1)
        self._current = TownChanges()

    def __call__(self) -> TownChanges:
        """The changes now."""
        version = (self._objects.version, self._lights.version)
        if version != self._version:
            self._version = version
            on_objects, on_props = self._objects.pictures, self._objects.prop_pictures
            self._current = TownChanges(
                self._objects.hidden(),
                dict(self._objects.paint),
                dict(self._objects.glow),
                (*on_objects.values(), *on_props.values()),
                {object_id: row for row, object_id in enumerate(on_objects)},
                {actor_id: row for row, actor_id in enumerate(on_props, len(on_objects))},
                self._lights.power(),
            )
        return self._current
