"""What an episode's spec asks of its labels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from carstage.errors import AnnotationError

METHODS: Final = ("stage_vo", "pixels", "both")


@dataclass(frozen=True, slots=True)
class LabelSettings:
    """Label settings of an ``EpisodeSpec``.

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
    max_distance_m: float = 80.0
    min_lidar_points: int = 0
    min_visible_px: int = 10
    distance_origin: str = "sensor"
    stage_vo_tolerance_m: float = 0.0
    stage_vo_strict: bool = False
    stage_vo_vote: bool = False

    @property
    def pixels(self) -> bool:
        """Whether pixels are counted."""
        return self.method != "stage_vo"

    @classmethod
    def from_spec(cls, spec: Mapping[str, Any]) -> LabelSettings:
        """Read them from a spec; what it leaves out has the defaults above.

        Raises:
            AnnotationError: when the method or the distance origin is unknown.
        """
        labels: Mapping[str, Any] = spec.get("labels", {})
        ground_truth: Mapping[str, Any] = spec.get("ground_truth", {})
        boxes = labels.get("boxes", ("2d", "3d"))
        settings = cls(
            method=labels.get("method", "both"),
            boxes_2d="2d" in boxes,
            boxes_3d="3d" in boxes,
            vehicles=bool(ground_truth.get("vehicles", True)),
            pedestrians=bool(ground_truth.get("pedestrians", True)),
            ego_motion=bool(ground_truth.get("ego_motion", True)),
            max_distance_m=float(spec.get("max_distance_m", 80.0)),
            min_lidar_points=int(spec.get("min_lidar_points", 0)),
            min_visible_px=int(labels.get("min_visible_px", 10)),
            distance_origin=labels.get("distance_origin", "sensor"),
            stage_vo_tolerance_m=float(labels.get("stage_vo_tolerance_m", 0.0)),
            stage_vo_strict=bool(labels.get("stage_vo_strict", False)),
            stage_vo_vote=bool(labels.get("stage_vo_vote", False)),
        )
        if settings.method not in METHODS:
            raise AnnotationError(
                f"spec.labels.method is {settings.method!r}.", f"Use one of {', '.join(METHODS)}."
            )
        if settings.distance_origin not in ("sensor", "ego"):
            raise AnnotationError(
                f"spec.labels.distance_origin is {settings.distance_origin!r}.",
                "Use sensor or ego.",
            )
        return settings
