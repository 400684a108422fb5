"""What an episode's labels hold, and how visibility is decided."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import List, Optional, Tuple

from carstage.spec.fields import Fields, SpecError
from carstage.spec.occupancy import OccupancySpec
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

METHODS = ("stage_vo", "pixels", "both")
BOXES = ("2d", "3d")
LEVEL_LABELS = {
    "parked_vehicles": ("Car", "Truck", "Bus", "Motorcycle", "Bicycle", "Vehicles"),
    "traffic_lights": ("TrafficLight",),
    "traffic_signs": ("TrafficSigns",),
    "bridges": ("Bridge",),
    "buildings": ("Buildings",),
    "dynamic": ("Dynamic",),
    "fences": ("Fences",),
    "guard_rails": ("GuardRail",),
    "other": ("Other",),
    "poles": ("Poles",),
    "rail_tracks": ("RailTrack",),
    "static": ("Static",),
    "terrain": ("Terrain",),
    "trains": ("Train",),
    "vegetation": ("Vegetation",),
    "walls": ("Walls",),
    "water": ("Water",),
}
"""Names of ``carla.CityObjectLabel`` by kind of level object.

Up to 0.9.13 there is one label for all vehicles.
"""
LEVEL_OBJECTS = tuple(sorted(LEVEL_LABELS))
"""Kinds of level objects that may be labelled."""
MOST_CELLS = 2000
"""Of a bird's-eye grid, along each side."""


@dataclass(frozen=True, eq=False, repr=False)
class GroundTruthSpec(Value):
    """Who is labelled, and whether the ego's motion is written."""

    vehicles: bool = True
    pedestrians: bool = True
    ego_motion: bool = True

    @classmethod
    def read(cls, fields: Fields) -> GroundTruthSpec:
        """Check and read the section."""
        names = ("vehicles", "pedestrians", "ego_motion")
        return cls(**{name: fields.flag(name) for name in names if name in fields})


@dataclass(frozen=True, eq=False, repr=False)
class BirdsEyeSpec(Value):
    """Bird's-eye grids around the ego.

    Attributes:
        length_m: along the ego's heading; half of it lies ahead.
        width_m: across it.
        resolution_m: side of a cell, a whole number of centimetres.
    """

    length_m: float = 100.0
    width_m: float = 100.0
    resolution_m: float = 0.2

    @classmethod
    def read(cls, fields: Fields) -> BirdsEyeSpec:
        """Check and read the section."""
        names = ("length_m", "width_m", "resolution_m")
        found = cls(**{name: fields.number(name, above=0.0) for name in names if name in fields})
        for name, why in found.faults():
            raise SpecError("%s: %s" % (fields.path(name), why))
        return found

    def faults(self) -> List[Tuple[str, str]]:
        """Fields that no grid can have, each with a sentence."""
        cm = 100.0 * self.resolution_m
        if abs(cm - round(cm)) > 1e-6 or cm < 1:
            return [("resolution_m", "%g m are no whole centimetres." % self.resolution_m)]
        found = []
        for name in ("length_m", "width_m"):
            cells = getattr(self, name) / self.resolution_m
            if abs(cells - round(cells)) > 1e-6 or not 1 <= cells <= MOST_CELLS:
                text = "%g m are not 1 to %d whole cells of %g m."
                found.append((name, text % (getattr(self, name), MOST_CELLS, self.resolution_m)))
        return found


@dataclass(frozen=True, eq=False, repr=False)
class LabelsSpec(Value):
    """Label settings.

    Attributes:
        method: ``stage_vo``, ``pixels`` or ``both``; decides ``visible`` (both: pixels).
        boxes: ``2d`` for 2D boxes and masks, ``3d`` for 3D boxes and angles.
        level_objects: what else is labelled, by its boxes in the level.
        min_visible_px: pixels from which an object is visible to the pixel method.
        distance_origin: ``sensor`` (the paper's text) or ``ego`` (its user interface).
        stage_vo_tolerance_m: how much nearer the depth must be to occlude; 0 is the paper.
        stage_vo_strict: level 2 instead of 3 when no vertex lies in the image.
        stage_vo_vote: compare with the diagonal neighbours instead of the vertex's own pixel.
        vector_map: whether the dataset gets the town's vector map.
        birds_eye: bird's-eye grids; None: there are none.
        occupancy: voxels; None: there are none.
        lane_lines: whether lines of the vector map are labelled in pictures.
        disparity: whether stereo pairs get their disparity.
    """

    method: str = "both"
    boxes: Tuple[str, ...] = BOXES
    level_objects: Tuple[str, ...] = ()
    min_visible_px: int = 10
    distance_origin: str = "sensor"
    stage_vo_tolerance_m: float = 0.0
    stage_vo_strict: bool = False
    stage_vo_vote: bool = False
    vector_map: bool = field(default=True, metadata=LEFT_OUT)
    birds_eye: Optional[BirdsEyeSpec] = field(default=None, metadata=LEFT_OUT)
    occupancy: Optional[OccupancySpec] = field(default=None, metadata=LEFT_OUT)
    lane_lines: bool = field(default=False, metadata=LEFT_OUT)
    disparity: bool = field(default=False, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> LabelsSpec:
        """Check and read the section; what it leaves out has the defaults above."""
        given = cls()
        return cls(
            method=fields.text("method", METHODS) if "method" in fields else given.method,
            boxes=fields.words("boxes", BOXES) if "boxes" in fields else given.boxes,
            level_objects=fields.words("level_objects", LEVEL_OBJECTS),
            min_visible_px=fields.integer("min_visible_px", 0)
            if "min_visible_px" in fields
            else given.min_visible_px,
            distance_origin=fields.text("distance_origin", ("sensor", "ego"))
            if "distance_origin" in fields
            else given.distance_origin,
            stage_vo_tolerance_m=fields.number("stage_vo_tolerance_m", least=0.0)
            if "stage_vo_tolerance_m" in fields
            else given.stage_vo_tolerance_m,
            stage_vo_strict="stage_vo_strict" in fields and fields.flag("stage_vo_strict"),
            stage_vo_vote="stage_vo_vote" in fields and fields.flag("stage_vo_vote"),
            vector_map="vector_map" not in fields or fields.flag("vector_map"),
            birds_eye=BirdsEyeSpec.read(fields.object("birds_eye"))
            if "birds_eye" in fields
            else None,
            occupancy=OccupancySpec.read(fields.object("occupancy"))
            if "occupancy" in fields
            else None,
            lane_lines="lane_lines" in fields and fields.flag("lane_lines"),
            disparity="disparity" in fields and fields.flag("disparity"),
        )

    @property
    def pixels(self) -> bool:
        """Whether pixels are counted."""
        return self.method != "stage_vo"

    @property
    def boxes_2d(self) -> bool:
        """Whether 2D boxes and masks are written."""
        return "2d" in self.boxes

    @property
    def boxes_3d(self) -> bool:
        """Whether 3D boxes and angles are written."""
        return "3d" in self.boxes
