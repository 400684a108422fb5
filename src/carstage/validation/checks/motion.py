"""What moves, moves as its velocity says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from carstage.validation.checks.findings import Findings

ABSOLUTE_TOLERANCE_M = 0.1
RELATIVE_TOLERANCE = 0.2
MIN_SHARE = 0.9
MIN_STEPS = 10
_LONGEST_STEP_S = 1.0


@dataclass(slots=True)
class MotionFigures:
    """Steps of objects from one saved frame to the next, and those that fit the velocities."""

    compared: int = 0
    agreeing: int = 0

    @property
    def share(self) -> float | None:
        """Share of steps that agree; ``None`` where too few can be compared."""
        return self.agreeing / self.compared if self.compared >= MIN_STEPS else None

    def add(self, other: MotionFigures) -> None:
        """Add the counts of another table."""
        self.compared += other.compared
        self.agreeing += other.agreeing

    def to_dict(self) -> dict[str, float | None]:
        """For the report."""
        share = self.share
        return {"steps": self.compared, "share": None if share is None else round(share, 6)}


def compare_motion(table: pa.Table, location: str) -> MotionFigures:
    """Compare the path of each track with its velocities.

    From one saved frame to the next a track moves by the mean of its two velocities times the
    time between (trapezoidal rule), to 0.1 m + 20 %. Steps longer than 1 s, and those in which
    neither places nor velocities show a motion beyond the tolerance, are left out.

    Args:
        table: ``k``, ``timestamp_s``, ``velocity``, the location, and ``track_id`` if it has many.
        location: the column that holds where the pivot is in the world (m).
    """
    ks = table["k"].to_numpy()
    tracks = table["track_id"].to_numpy() if "track_id" in table.column_names else np.zeros(len(ks))
    order = np.lexsort((ks, tracks))
    ks, tracks = ks[order], tracks[order]
    times_s = table["timestamp_s"].to_numpy()[order]
    places, velocities = _vectors(table, location)[order], _vectors(table, "velocity")[order]
    step_s = np.diff(times_s)
    follows = (np.diff(tracks) == 0) & (np.diff(ks) == 1) & (step_s <= _LONGEST_STEP_S)
    moved = np.diff(places, axis=0)
    expected = (velocities[1:] + velocities[:-1]) / 2.0 * step_s[:, None]
    length = np.maximum(np.linalg.norm(moved, axis=1), np.linalg.norm(expected, axis=1))
    compared = follows & (length > ABSOLUTE_TOLERANCE_M)
    error = np.linalg.norm(moved - expected, axis=1)[compared]
    agrees = error <= ABSOLUTE_TOLERANCE_M + RELATIVE_TOLERANCE * length[compared]
    return MotionFigures(int(compared.sum()), int(agrees.sum()))


def _vectors(table: pa.Table, column: str) -> NDArray[np.float64]:
    """``(N, 3)`` of a column of vectors."""
    return np.array(table[column].to_pylist(), np.float64).reshape(-1, 3)


def check_motion(name: str, figures: MotionFigures, findings: Findings) -> None:
    """Warn of a table in which less than nine tenths of the steps agree (check ``motion``).

    A warning only: a server may move actors by setting their places, and in replays it does.
    """
    share = figures.share
    if share is not None and share < MIN_SHARE:
        findings.add(
            "motion",
            f"{name}: {share:.1%} of {figures.compared} steps from frame to frame are those that "
            f"the velocities give; at least {MIN_SHARE:.0%} are expected",
            severity="warning",
        )
