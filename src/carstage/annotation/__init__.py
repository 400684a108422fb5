"""From recorded truth to labels: pure functions of the raw log, in numpy.

The rules stand in ``docs/conventions.md``, the columns in ``carstage.annotation.schema``.
"""

from carstage.annotation.labeller import CameraImages, CameraInputs, EpisodeLabeller, FrameLabels

__all__ = ["CameraImages", "CameraInputs", "EpisodeLabeller", "FrameLabels"]
