"""Voxels around the ego or a sensor."""

from __future__ import annotations

from typing import Any

from pydantic import model_validator

from carstage.config.fields import Section, problem, setting
from carstage.spec import OccupancySpec


def _reach(name: str, title: str, description: str) -> Any:
    return setting(
        getattr(OccupancySpec, name),
        title=title,
        description=description,
        unit="m",
        group="labels",
        ge=0,
        le=500,
    )


class Occupancy(Section):
    """Voxels of semantics, objects, motion and visibility; the defaults are Occ3D's."""

    frame: str = setting(
        OccupancySpec.frame,
        title="Frame",
        description="Whose place and axes they have: `ego`, or a sensor's id such as a LiDAR's.",
        group="labels",
    )
    ahead_m: float = _reach("ahead_m", "Ahead", "How far they reach to the front.")
    behind_m: float = _reach("behind_m", "Behind", "How far they reach to the back.")
    left_m: float = _reach("left_m", "Left", "How far they reach to the left.")
    right_m: float = _reach("right_m", "Right", "How far they reach to the right.")
    up_m: float = _reach("up_m", "Up", "How far they reach upwards.")
    down_m: float = _reach("down_m", "Down", "How far they reach downwards.")
    resolution_m: float = setting(
        OccupancySpec.resolution_m,
        title="Resolution",
        description="Side of a voxel, in whole centimetres.",
        unit="m",
        group="labels",
        ge=0.05,
        le=10,
    )
    exact: bool = setting(
        OccupancySpec.exact,
        title="Exact",
        description="All surfaces of the world, seen or not. The embedded simulator alone can "
        "tell them.",
        group="labels",
    )

    @model_validator(mode="after")
    def _check_voxels(self) -> Occupancy:
        for name, sentence in OccupancySpec(**self.model_dump()).faults():
            raise problem(sentence, "Such as 40 m and 40 m at 0.4 m.", name)
        return self
