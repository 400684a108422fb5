"""Which voxels an episode's frames are divided into."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import List, Tuple

from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.sensors import EGO
from carstage.spec.values import Value

MOST_VOXELS = 1 << 22
"""Of one frame."""
_SIDES = (("ahead_m", "behind_m"), ("left_m", "right_m"), ("up_m", "down_m"))
LENGTHS = (*(name for pair in _SIDES for name in pair), "resolution_m")
"""The fields that say how far voxels reach, and how large they are."""


@dataclass(frozen=True, eq=False, repr=False)
class OccupancySpec(Value):
    """Voxels around the ego or a sensor; the defaults are those of Occ3D-nuScenes.

    Attributes:
        frame: whose place and axes the voxels have: ``ego``, or a sensor's id.
        ahead_m, behind_m, left_m, right_m, up_m, down_m: how far they reach.
        resolution_m: side of a voxel, a whole number of centimetres.
        exact: whether a sensor of the embedded simulator says what is in them; else it is what
            sensors have seen over the episode.
    """

    frame: str = EGO
    ahead_m: float = 40.0
    behind_m: float = 40.0
    left_m: float = 40.0
    right_m: float = 40.0
    up_m: float = 5.4
    down_m: float = 1.0
    resolution_m: float = 0.4
    exact: bool = field(default=False, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> OccupancySpec:
        """Check and read the section."""
        frame = fields.text("frame") if "frame" in fields else cls.frame
        reach = {
            name: fields.number(name, least=0.0)
            for pair in _SIDES
            for name in pair
            if name in fields
        }
        if "resolution_m" in fields:
            reach["resolution_m"] = fields.number("resolution_m", above=0.0)
        exact = "exact" in fields and fields.flag("exact")
        found = cls(frame=frame, exact=exact, **reach)
        for name, why in found.faults():
            raise SpecError("%s: %s" % (fields.path(name), why))
        return found

    @property
    def cells(self) -> Tuple[float, float, float]:
        """Voxels along forward, left and up."""
        lengths = [getattr(self, one) + getattr(self, other) for one, other in _SIDES]
        x, y, z = (length / self.resolution_m for length in lengths)
        return x, y, z

    def faults(self) -> List[Tuple[str, str]]:
        """Fields that no voxels can have, each with a sentence."""
        cm = 100.0 * self.resolution_m
        if abs(cm - round(cm)) > 1e-6 or cm < 5:
            text = "%g m are no whole centimetres from 5 on."
            return [("resolution_m", text % self.resolution_m)]
        found = []
        for (name, other), cells in zip(_SIDES, self.cells):
            if abs(cells - round(cells)) > 1e-6 or cells < 0.5:
                text = "with %s it is no whole number of voxels of %g m."
                found.append((name, text % (other, self.resolution_m)))
        x, y, z = self.cells
        if not found and x * y * z > MOST_VOXELS:
            text = "%d voxels a frame are more than %d."
            found.append(("resolution_m", text % (x * y * z, MOST_VOXELS)))
        return found
