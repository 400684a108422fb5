"""Recompute from the files whether a dataset is what it says it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        check: name of the check that found it.
        severity: an ``error`` makes the dataset invalid, a ``warning`` does not.
        episode, frame, sensor: where; ``frame`` is the saved-frame index ``k``.
        message: what, in one sentence.
    """

    check: str
    severity: Literal["error", "warning"]
    episode: str | None
    frame: int | None
    sensor: str | None
    message: str


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """The verdict over a dataset."""

    problems: tuple[Problem, ...]
    figures: dict[str, Any]

    @property
    def ok(self) -> bool:
        """Whether no problem is an error."""
        return not any(problem.severity == "error" for problem in self.problems)

    def to_json(self) -> str:
        """The report as one JSON object."""
        raise NotImplementedError


def validate_dataset(
    path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> ValidationReport:
    """Check every committed episode.

    Args:
        path: folder of the dataset.
        progress: called with (frames done, frames in all).
    """
    raise NotImplementedError
