"""What an episode's spec asks of its labels."""

from __future__ import annotations

from dataclasses import dataclass

from carstage.spec import EpisodeSpec
from carstage.spec.defaults import MAX_DISTANCE_M, MIN_VISIBLE_PX


@dataclass(frozen=True, slots=True)
class LabelSettings:
    """What an ``EpisodeSpec`` asks of its labels, side by side.

    Attributes:
        method: ``stage_vo``, ``pixels`` or ``both``; decides ``visible`` (both: pixels).
        boxes_2d: whether 2D boxes and masks are written.
        boxes_3d: whether 3D boxes and angles are written.
        vehicles: whether vehicles are labelled.
        pedestrians: whether walkers are labelled.
        ego_motion: whether the ego record is written.
        max_distance_m: objects farther away get no camera record.
        min_lidar_points: points below which an object is not visible, where the rig has a LiDAR.
        min_visible_px: pixels from which an object is visible to the pixel method.
        distance_origin: ``sensor`` (the paper's text) or ``ego`` (its GUI).
        stage_vo_tolerance_m: how much nearer the depth must be to occlude; 0 is the paper.
        stage_vo_strict: level 2 instead of 3 when no vertex lies in the image.
        stage_vo_vote: compare with the diagonal neighbours instead of the vertex's own pixel.
    """

    method: str = "both"
    boxes_2d: bool = True
    boxes_3d: bool = True
    vehicles: bool = True
    pedestrians: bool = True
    ego_motion: bool = True
    max_distance_m: float = MAX_DISTANCE_M
    min_lidar_points: int = 0
    min_visible_px: int = MIN_VISIBLE_PX
    distance_origin: str = "sensor"
    stage_vo_tolerance_m: float = 0.0
    stage_vo_strict: bool = False
    stage_vo_vote: bool = False

    @property
    def pixels(self) -> bool:
        """Whether pixels are counted."""
        return self.method != "stage_vo"

    @classmethod
    def from_spec(cls, spec: EpisodeSpec) -> LabelSettings:
        """What an episode asks for."""
        labels, ground_truth = spec.labels, spec.ground_truth
        return cls(
            method=labels.method,
            boxes_2d=labels.boxes_2d,
            boxes_3d=labels.boxes_3d,
            vehicles=ground_truth.vehicles,
            pedestrians=ground_truth.pedestrians,
            ego_motion=ground_truth.ego_motion,
            max_distance_m=spec.max_distance_m,
            min_lidar_points=spec.min_lidar_points,
            min_visible_px=labels.min_visible_px,
            distance_origin=labels.distance_origin,
            stage_vo_tolerance_m=labels.stage_vo_tolerance_m,
            stage_vo_strict=labels.stage_vo_strict,
            stage_vo_vote=labels.stage_vo_vote,
        )
