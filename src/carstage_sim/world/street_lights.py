"""Street lights as clients switch them: ``carla.LightManager``'s side of the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.street_lamps import StreetLamps

LAMPS_ON_BELOW_DEG = 4.0
"""Altitude of the sun below which the day-night cycle has the lamps on."""

INTENSITY = 10_000.0
"""Intensity that a lamp begins with, in CARLA's unit (lumen); it shines as bright as the town's."""

COLOUR = (255, 232, 190)
"""Colour that a lamp begins with, sRGB."""

STREET_GROUP = 2
"""``carla.LightGroup.Street``."""


@dataclass(frozen=True, slots=True)
class LightState:
    """One light: number, intensity, ``carla.LightGroup``, sRGB colour, and whether it is on."""

    light_id: int
    intensity: float
    group: int
    colour: tuple[int, int, int]
    active: bool


class StreetLights:
    """The switchable lights of a town.

    Args:
        lamps: where they are; a lamp's id is its index + 1.

    Attributes:
        lamps: as given.
        version: counts up whenever a light changes.
        day_night_cycle: whether the sun's altitude switches them.
        changed_since_frame: whether a light changed between the frame before and this one.
    """

    def __init__(self, lamps: StreetLamps) -> None:
        count = len(lamps)
        self.lamps = lamps
        self.version = 0
        self.day_night_cycle = True
        self.changed_since_frame = False
        self._shown_version = 0
        self._dark = False
        self._active: NDArray[np.bool_] = np.zeros(count, np.bool_)
        self._intensity: NDArray[np.float32] = np.full(count, INTENSITY, np.float32)
        self._colour: NDArray[np.uint8] = np.tile(np.array(COLOUR, np.uint8), (count, 1))
        self._group: NDArray[np.uint8] = np.full(count, STREET_GROUP, np.uint8)

    def __len__(self) -> int:
        return len(self.lamps)

    def states(self) -> list[LightState]:
        """All lights, ascending ids."""
        return [
            LightState(
                index + 1,
                float(self._intensity[index]),
                int(self._group[index]),
                (int(red), int(green), int(blue)),
                bool(self._active[index]),
            )
            for index, (red, green, blue) in enumerate(self._colour)
        ]

    def apply(self, states: Sequence[LightState]) -> None:
        """Set lights; ids that no light has are passed over, as CARLA does."""
        for state in states:
            index = state.light_id - 1
            if not 0 <= index < len(self):
                continue
            self._active[index] = state.active
            self._intensity[index] = max(state.intensity, 0.0)
            self._colour[index] = state.colour
            self._group[index] = state.group
            self.version += 1

    def follow_sun(self, altitude_deg: float) -> bool:
        """Dusk and dawn switch all lights while the cycle is active; whether they did.

        Between the two, what a client switches stays as it is.
        """
        dark = altitude_deg < LAMPS_ON_BELOW_DEG
        turned = dark != self._dark
        self._dark = dark
        if not turned or not self.day_night_cycle or not len(self):
            return False
        self._active[:] = dark
        self.version += 1
        return True

    def set_day_night_cycle(self, active: bool) -> bool:
        """Hand the lights to the sun, or keep them as they are; whether a light changed."""
        began = active and not self.day_night_cycle
        self.day_night_cycle = active
        if not began or bool((self._active == self._dark).all()):
            return False
        self._active[:] = self._dark
        self.version += 1
        return True

    def step(self) -> None:
        """Begin a frame."""
        self.changed_since_frame = self.version != self._shown_version
        self._shown_version = self.version

    def power(self) -> NDArray[np.float32]:
        """``(L, 3)`` float32 light of each lamp, linear RGB; a white new lamp has 1."""
        brightness = np.where(self._active, self._intensity / np.float32(INTENSITY), np.float32(0))
        linear = (self._colour / np.float32(255.0)) ** np.float32(2.2)
        return (linear * brightness[:, None]).astype(np.float32)
