"""The disparity of an episode's stereo pairs while it is converted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from carstage.annotation import CameraImages
from carstage.codecs.png import PngPacker
from carstage.geometry.stereo import CameraPair, StereoCamera, disparity_steps
from carstage.plan.stereo import disparity_name, planned_pairs
from carstage.spec import EpisodeSpec


class DisparityMaker:
    """Makes the files of an episode's frames, each by itself.

    Args:
        spec: of the episode.
    """

    def __init__(self, spec: EpisodeSpec) -> None:
        self._pairs = planned_pairs(spec.sensors)
        self._packer = PngPacker()

    def files(self, k: int, images: Mapping[str, CameraImages]) -> list[tuple[str, bytes]]:
        """Names and contents of a frame's files, two for each pair.

        Args:
            k: index of the saved frame.
            images: by labelled camera; of one that is missing nothing is known.
        """
        return [
            (disparity_name(camera.id, k), self._file(camera, pair, images.get(camera.id)))
            for pair in self._pairs
            for camera in (pair.left, pair.right)
        ]

    def _file(self, camera: StereoCamera, pair: CameraPair, image: CameraImages | None) -> bytes:
        if image is None:
            return self._packer.pack(np.zeros((camera.height, camera.width), np.uint16))
        steps = disparity_steps(image.depth_m, pair.focal_px, pair.baseline_m)
        return self._packer.pack(steps)
