"""Recomputing what a dataset promises from its files alone.

``validate_dataset`` runs every rule of ``checks`` and returns a ``ValidationReport``.
"""

from carstage.validation.checks.findings import Problem
from carstage.validation.validator import ValidationReport, validate_dataset

__all__ = ["Problem", "ValidationReport", "validate_dataset"]
