"""Reading a dataset; needs nothing but its files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.birds_eye import BirdsEye
    from carstage.dataset.calibration import Calibration, SensorCalibration
    from carstage.dataset.collection import Dataset
    from carstage.dataset.masks import decode_mask
    from carstage.dataset.reading import Episode, Sensor
    from carstage.dataset.samples import FrameSamples
    from carstage.dataset.saved_frames import EpisodeFrames, Frame
    from carstage.dataset.splits import SplitRule, StoredSplits
    from carstage.dataset.splitting import split_dataset
    from carstage.dataset.variants import EpisodeVariants
    from carstage.occupancy import Occupancy

__all__ = [
    "BirdsEye",
    "Calibration",
    "Dataset",
    "Episode",
    "EpisodeFrames",
    "EpisodeVariants",
    "Frame",
    "FrameSamples",
    "Occupancy",
    "Sensor",
    "SensorCalibration",
    "SplitRule",
    "StoredSplits",
    "decode_mask",
    "split_dataset",
]

__getattr__ = lazy_names(
    __name__,
    {
        ".birds_eye": "BirdsEye",
        "calibration": "Calibration SensorCalibration",
        "collection": "Dataset",
        "masks": "decode_mask",
        "reading": "Episode Sensor",
        "samples": "FrameSamples",
        "saved_frames": "EpisodeFrames Frame",
        "splits": "SplitRule StoredSplits",
        "splitting": "split_dataset",
        "variants": "EpisodeVariants",
        ".occupancy": "Occupancy",
    },
)
