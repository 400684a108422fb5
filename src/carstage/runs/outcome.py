"""How a run ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from carstage.runs.folder import State
from carstage.storage import DatasetPath

SOME_FAILED = 3
"""Exit code: some episodes are in the dataset and some are not."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended.

    Attributes:
        run_id: name of the run's folder.
        dataset: folder of the dataset, or its place in an object store.
        folder: the run's folder with plan, status, events and logs.
        state: ``done``, ``failed`` or ``interrupted``.
        total: episodes that the configuration asks for.
        committed: episodes that this run has added to the dataset.
        skipped: episodes that were there already.
        frames: saved frames of the episodes that this run has added.
        failures: what went wrong, by episode id.
    """

    run_id: str
    dataset: DatasetPath
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
        return SOME_FAILED if self.committed or self.skipped else 1

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
