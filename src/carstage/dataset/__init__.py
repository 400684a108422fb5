"""Reading a dataset; needs nothing but its files."""

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
