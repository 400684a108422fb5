"""Reading, checking and showing a dataset; needs nothing but its files."""

from carstage.dataset.reading import Dataset, Episode
from carstage.dataset.report import write_report
from carstage.dataset.validation import Problem, ValidationReport, validate_dataset

__all__ = [
    "Dataset",
    "Episode",
    "Problem",
    "ValidationReport",
    "validate_dataset",
    "write_report",
]
