"""Labels of one episode: world snapshots and sensor data in, rows of the label tables out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from carstage.rawlog.reader import ActorInfo, WorldFrame


@dataclass(frozen=True, slots=True)
class CameraImages:
    """What one labelled camera saw in one frame.

    Attributes:
        depth_m: ``(H, W)`` float32, distance along the optical axis (m).
        instance_bgra: ``(H, W, 4)`` uint8 of the instance camera with the same pose, or None.
        semantic_tag: ``(H, W)`` uint8 of a semantic camera with the same pose, or None.
    """

    depth_m: NDArray[np.float32]
    instance_bgra: NDArray[np.uint8] | None = None
    semantic_tag: NDArray[np.uint8] | None = None


@dataclass(frozen=True, slots=True)
class CameraInputs:
    """Streams of the raw log that a labelled camera's labels are made from.

    Attributes:
        depth: the depth camera's stream.
        instance: the instance camera's stream, or None when labels need none.
    """

    depth: str
    instance: str | None


@dataclass(frozen=True, slots=True)
class FrameLabels:
    """Rows of one frame, as ``carstage.annotation.schema`` describes them.

    Attributes:
        objects: one per vehicle and pedestrian.
        camera_objects: one per labelled camera and object that its image can hold.
        ego: the ego record; empty when ego motion was not asked for.
    """

    objects: list[dict[str, Any]]
    camera_objects: list[dict[str, Any]]
    ego: dict[str, Any]


class EpisodeLabeller:
    """Labels the frames of one episode; frames may come in any order."""

    def __init__(self, header: Mapping[str, Any], actors: Mapping[int, ActorInfo]) -> None:
        """Args: ``header``: the raw log's ``episode.json``; ``actors``: static facts by id."""
        self.labelled_cameras: tuple[str, ...] = ()

    def inputs(self, camera_id: str) -> CameraInputs:
        """The streams that ``label_frame`` needs for a labelled camera."""
        raise NotImplementedError

    def label_frame(
        self,
        world: WorldFrame,
        k: int,
        images: Mapping[str, CameraImages],
        lidar: Mapping[str, NDArray[np.float32]],
    ) -> FrameLabels:
        """Labels of the saved frame ``k``."""
        raise NotImplementedError
