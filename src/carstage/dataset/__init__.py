"""Reading, checking and showing a dataset; needs nothing but its files."""

from carstage.dataset.checks.findings import Problem
from carstage.dataset.frames import EpisodeFrames, Frame
from carstage.dataset.masks import decode_mask
from carstage.dataset.reading import (
    Calibration,
    Dataset,
    Episode,
    Sensor,
    SensorCalibration,
)
from carstage.dataset.report import write_report, write_validation
from carstage.dataset.samples import FrameSamples
from carstage.dataset.validation import ValidationReport, validate_dataset

__all__ = [
    "Calibration",
    "Dataset",
    "Episode",
    "EpisodeFrames",
    "Frame",
    "FrameSamples",
    "Problem",
    "Sensor",
    "SensorCalibration",
    "ValidationReport",
    "decode_mask",
    "validate_dataset",
    "write_report",
    "write_validation",
]
