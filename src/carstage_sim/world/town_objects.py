"""The town's own objects as clients change them: switched off, painted, and made to glow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from carstage_sim.maps.town import LevelObject
from carstage_sim.world.pictures import PlacedPicture

Colour = tuple[float, float, float]
"""Linear red, green, blue; 1 is white."""

_ALL_LAYERS = 0xFFFF
MOST_TEXELS = 8_000_000
"""Pixels of all pictures together; with their halves, single precision can count them."""


class TownObjects:
    """What clients changed about the level objects of a town; a new episode begins unchanged.

    Attributes:
        version: counts up whenever an object changes.
        paint: surface colour that replaces an object's own, by object id.
        glow: light that an object emits, by object id.
        pictures: pictures that replace an object's own surface colour, by object id.
        prop_pictures: pictures on props, by actor id.
    """

    def __init__(self, objects: Sequence[LevelObject]) -> None:
        self.version = 0
        self.paint: dict[int, Colour] = {}
        self.glow: dict[int, Colour] = {}
        self.pictures: dict[int, PlacedPicture] = {}
        self.prop_pictures: dict[int, PlacedPicture] = {}
        self._objects = objects
        self._disabled: set[int] = set()
        self._layers = _ALL_LAYERS

    def enable(self, object_ids: Iterable[int], enabled: bool) -> None:
        """Show objects or take them away; unknown ids are passed over, as CARLA does."""
        known = {piece.object_id for piece in self._objects}.intersection(object_ids)
        self._disabled = self._disabled - known if enabled else self._disabled | known
        self.version += 1

    def load_layers(self, layers: int, loaded: bool) -> None:
        """Show or take away all objects of some ``carla.MapLayer`` bits."""
        self._layers = self._layers | layers if loaded else self._layers & ~layers
        self.version += 1

    def hidden(self) -> frozenset[int]:
        """Ids of the objects that are not there for sensors, rays and collisions."""
        unloaded = (piece.object_id for piece in self._objects if not self.is_loaded(piece))
        return frozenset(self._disabled.union(unloaded))

    def is_loaded(self, piece: LevelObject) -> bool:
        """Whether the layer of an object is there, whatever became of the object itself."""
        return not piece.layer or bool(piece.layer & self._layers)

    def named(self, names: Sequence[str]) -> list[int]:
        """Ids of the objects with one of these names."""
        wanted = set(names)
        return [piece.object_id for piece in self._objects if piece.name in wanted]

    def apply_paint(self, object_ids: Iterable[int], colour: Colour) -> None:
        """Give objects another surface colour."""
        chosen = dict.fromkeys(object_ids, colour)
        self.paint.update(chosen)
        for object_id in chosen:
            self.pictures.pop(object_id, None)
        self.version += 1

    def apply_pictures(
        self, objects: Mapping[int, PlacedPicture], props: Mapping[int, PlacedPicture]
    ) -> None:
        """Put pictures on objects, by object id, and on props, by actor id.

        Raises:
            ValueError: all pictures together would be too large.
        """
        pictures, prop_pictures = {**self.pictures, **objects}, {**self.prop_pictures, **props}
        placed = (*pictures.values(), *prop_pictures.values())
        if sum(one.texels.size // 3 for one in placed) > MOST_TEXELS:
            raise ValueError(f"pictures on objects have more than {MOST_TEXELS} pixels together")
        self.pictures, self.prop_pictures = pictures, prop_pictures
        self.paint.update(dict.fromkeys(objects, (0.0, 0.0, 0.0)))
        self.version += 1

    def forget_prop(self, actor_id: int) -> None:
        """Drop the picture on a prop that is gone."""
        if actor_id in self.prop_pictures:
            left = {prop: one for prop, one in self.prop_pictures.items() if prop != actor_id}
            self.prop_pictures = left
            self.version += 1

    def apply_glow(self, object_ids: Iterable[int], colour: Colour) -> None:
        """Let objects emit light; it does not reach other surfaces."""
        self.glow.update(dict.fromkeys(object_ids, colour))
        self.version += 1
