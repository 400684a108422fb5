"""What is labelled, and how visibility is decided."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Strict, model_validator

from carstage.config.fields import Names, Section, problem, setting
from carstage.config.occupancy import Occupancy
from carstage.spec import BirdsEyeSpec, GroundTruthSpec, LabelsSpec


class GroundTruth(Section):
    """What the label tables hold."""

    vehicles: bool = setting(
        GroundTruthSpec.vehicles, title="Vehicles", description="Label vehicles.", group="labels"
    )
    pedestrians: bool = setting(
        GroundTruthSpec.pedestrians,
        title="Pedestrians",
        description="Label pedestrians.",
        group="labels",
    )
    ego_motion: bool = setting(
        GroundTruthSpec.ego_motion,
        title="Ego motion",
        description="Record pose, speed and controls of the ego.",
        group="labels",
    )


LevelObjectKind = Literal[
    "parked_vehicles", "traffic_lights", "traffic_signs", "bridges", "buildings", "dynamic",
    "fences", "guard_rails", "other", "poles", "rail_tracks", "static", "terrain", "trains",
    "vegetation", "walls", "water",
]  # fmt: skip
"""What may be labelled of a level: CARLA's city object labels, those of vehicles as one."""
DEFAULT_LEVEL_OBJECTS: tuple[LevelObjectKind, ...] = (
    "parked_vehicles",
    "traffic_lights",
    "traffic_signs",
)


class BirdsEye(Section):
    """Bird's-eye grids of semantics, objects, height and visibility around the ego."""

    length_m: float = setting(
        BirdsEyeSpec.length_m,
        title="Length",
        description="Along the ego's heading; half of it lies ahead.",
        unit="m",
        group="labels",
        gt=0,
        le=2000,
    )
    width_m: float = setting(
        BirdsEyeSpec.width_m,
        title="Width",
        description="Across the ego's heading.",
        unit="m",
        group="labels",
        gt=0,
        le=2000,
    )
    resolution_m: float = setting(
        BirdsEyeSpec.resolution_m,
        title="Resolution",
        description="Side of a cell, in whole centimetres.",
        unit="m",
        group="labels",
        ge=0.01,
        le=10,
    )

    @model_validator(mode="after")
    def _check_cells(self) -> BirdsEye:
        for name, sentence in BirdsEyeSpec(**self.model_dump()).faults():
            raise problem(sentence, "Such as 100 m by 100 m at 0.2 m.", name)
        return self


class Labels(Section):
    """How visibility is decided and which boxes are written."""

    method: Literal["stage_vo", "pixels", "both"] = setting(
        LabelsSpec.method,
        title="Visibility method",
        basic=True,
        description="`stage_vo`: the paper's eight corners against depth; `pixels`: instance "
        "pixels; `both`: both, side by side.",
        group="labels",
    )
    boxes: Annotated[tuple[Literal["2d", "3d"], ...], Strict(strict=False)] = setting(
        LabelsSpec.boxes, title="Boxes", basic=True, description="Kinds of boxes.", group="labels"
    )
    cameras: Literal["all"] | Names = setting(
        "all",
        title="Labelled cameras",
        description="`all`: every camera of colours; or a list of sensor ids; `[]` labels none.",
        group="labels",
    )
    lidars: Literal["all"] | Names = setting(
        (),
        title="Labelled LiDARs",
        description="`all`, or a list of sensor ids: beside each a semantic LiDAR is recorded, so "
        "that exports can label its points.",
        group="labels",
    )
    level_objects: Annotated[tuple[LevelObjectKind, ...], Strict(strict=False)] = setting(
        DEFAULT_LEVEL_OBJECTS,
        title="Level objects",
        description="What else of the town is labelled, by its boxes in the level; a town has "
        "many buildings. `[]`: actors.",
        group="labels",
    )
    min_visible_px: int = setting(
        LabelsSpec.min_visible_px,
        title="Minimum visible pixels",
        description="Pixels from which an object is visible to the pixel method.",
        unit="px",
        group="labels",
        ge=1,
        le=1_000_000,
    )
    distance_origin: Literal["sensor", "ego"] = setting(
        LabelsSpec.distance_origin,
        title="Distance from",
        description="Where max_distance_m counts from: the `sensor` (the paper's text) or the "
        "`ego` (its user interface).",
        group="labels",
    )
    stage_vo_tolerance_m: float = setting(
        LabelsSpec.stage_vo_tolerance_m,
        title="STAGE-VO tolerance",
        description="How much nearer than a corner the depth must be to occlude it; 0 is the "
        "paper.",
        unit="m",
        group="labels",
        ge=0,
        le=10,
    )
    stage_vo_strict: bool = setting(
        LabelsSpec.stage_vo_strict,
        title="STAGE-VO strict",
        description="Level 2 (the paper) instead of 3, unknown, when no corner is in the image.",
        group="labels",
    )
    stage_vo_vote: bool = setting(
        LabelsSpec.stage_vo_vote,
        title="STAGE-VO vote",
        description="Compare a corner with its four diagonal neighbour pixels instead of its own.",
        group="labels",
    )
    vector_map: bool = setting(
        LabelsSpec.vector_map,
        title="Vector map",
        description="Add the town's lanes, markings, crosswalks, stop lines and signals, once per "
        "town.",
        group="labels",
    )
    birds_eye: BirdsEye | None = setting(
        None,
        title="Bird's-eye grids",
        description="Add a grid around the ego to each frame: map, objects, velocity, height, "
        "visibility. `{}` takes the defaults.",
        group="labels",
    )
    occupancy: Occupancy | None = setting(
        None,
        title="Occupancy",
        description="Add voxels to each frame: classes, objects, motion, what sensors see. `{}` "
        "takes the defaults.",
        group="labels",
    )

    lane_lines: bool = setting(
        LabelsSpec.lane_lines,
        title="Lane lines in pictures",
        description="Add the vector map's markings, crosswalks and stop lines as each labelled "
        "camera sees them.",
        group="labels",
    )
    disparity: bool = setting(
        LabelsSpec.disparity,
        title="Disparity",
        description="Add the exact disparity of labelled cameras that are rectified stereo pairs.",
        group="labels",
    )

    @model_validator(mode="after")
    def _check_lane_lines(self) -> Labels:
        if self.lane_lines and not self.vector_map:
            raise problem(
                "is made from the vector map.", "Set labels.vector_map to true.", "lane_lines"
            )
        return self

    @model_validator(mode="after")
    def _check_boxes(self) -> Labels:
        for name in ("birds_eye", "occupancy"):
            if getattr(self, name) is not None and "3d" not in self.boxes:
                raise problem("is made from 3D boxes.", "Add `3d` to labels.boxes.", name)
        return self
