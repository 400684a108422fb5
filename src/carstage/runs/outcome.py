"""Who watches a run, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from carstage.plan import RunEstimate
from carstage.runs.folder import RunStatus, State


class RunObserver(Protocol):
    """Who watches a run, such as the command line's progress bars."""

    def planned(self, estimate: RunEstimate, todo: int, skipped: int) -> None:
        """The run is planned and fits on the disk."""

    def status(self, status: RunStatus) -> None:
        """The status, several times a second."""

    def event(self, event: Mapping[str, Any]) -> None:
        """An event, as it is written to ``events.jsonl``."""

    def notify(self, sentence: str) -> None:
        """Something that the user should read."""


class Nobody:
    """Watches nothing."""

    def planned(self, estimate: RunEstimate, todo: int, skipped: int) -> None:
        """Nothing."""

    def status(self, status: RunStatus) -> None:
        """Nothing."""

    def event(self, event: Mapping[str, Any]) -> None:
        """Nothing."""

    def notify(self, sentence: str) -> None:
        """Nothing."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended.

    Attributes:
        state: ``done``, ``failed`` or ``interrupted``.
        committed: episodes that this run has added to the dataset.
        skipped: episodes that were there already.
        failures: what went wrong, by episode id.
    """

    run_id: str
    dataset: Path
    folder: Path
    state: State
    total: int
    committed: int
    skipped: int
    frames: int
    failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def exit_code(self) -> int:
        """0 all there, 1 none of the new ones, 3 some of them, 130 interrupted."""
        if self.state == "interrupted":
            return 130
        if not self.failures:
            return 0
        return 3 if self.committed or self.skipped else 1

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "run_id": self.run_id,
            "dataset": str(self.dataset),
            "run_folder": str(self.folder),
            "state": self.state,
            "episodes": {
                "total": self.total,
                "committed": self.committed,
                "skipped": self.skipped,
                "failed": len(self.failures),
            },
            "frames": self.frames,
            "failures": dict(self.failures),
        }
