"""What checks report: problems with their place, and figures."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

from carstage.validation.checks.catalogue import RULES

Severity = Literal["error", "warning"]
_MOST_OF_ONE_KIND = 25


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        check: name of the check that found it.
        severity: an ``error`` makes the dataset invalid, a ``warning`` does not.
        episode: id of the episode; ``None``: the dataset as a whole.
        frame: saved-frame index ``k``, where it is about one frame.
        sensor: id of the sensor, where it is about one.
        message: what, in one sentence.
    """

    check: str
    severity: Severity
    episode: str | None
    frame: int | None
    sensor: str | None
    message: str


class Findings:
    """Collects the problems of one episode; after 25 of one check and sensor only counts.

    The checks are those of ``carstage.validation.checks.catalogue``.

    Args:
        episode: its id; None: the dataset as a whole.
        agent: name of the agent beside the ego that they are about; messages begin with it.
    """

    def __init__(self, episode: str | None, agent: str | None = None) -> None:
        self.episode = episode
        self._whose = "" if agent is None else f"agent {agent}: "
        self._problems: list[Problem] = []
        self._counts: Counter[tuple[str, Severity, str | None]] = Counter()

    def add(
        self,
        check: str,
        message: str,
        *,
        frame: int | None = None,
        sensor: str | None = None,
        severity: Severity = "error",
    ) -> None:
        """Report a problem."""
        if check not in RULES:
            raise ValueError(f"{check} is no check of the catalogue")
        self._counts[check, severity, sensor] += 1
        if self._counts[check, severity, sensor] <= _MOST_OF_ONE_KIND:
            said = self._whose + message
            self._problems.append(Problem(check, severity, self.episode, frame, sensor, said))

    def include(self, later: Findings) -> None:
        """Add what others found of the same episode, as if it had been reported here."""
        listed: Counter[tuple[str, Severity, str | None]] = Counter()
        for problem in later._problems:
            kind = problem.check, problem.severity, problem.sensor
            if self._counts[kind] + listed[kind] < _MOST_OF_ONE_KIND:
                self._problems.append(problem)
                listed[kind] += 1
        self._counts.update(later._counts)

    def taken(self) -> Findings:
        """All of it in an object of its own; nothing is left here."""
        taken = Findings(self.episode)
        taken._problems, self._problems = self._problems, []
        taken._counts, self._counts = self._counts, Counter()
        return taken

    def count(self, totals: dict[str, dict[Severity, int]]) -> None:
        """Add the number of problems to totals by check and severity."""
        for (check, severity, _), count in self._counts.items():
            totals[check][severity] += count

    def problems(self) -> list[Problem]:
        """All problems, and one line for each kind of which there were more than are listed."""
        more = [
            Problem(check, severity, self.episode, None, sensor,
                    f"and {count - _MOST_OF_ONE_KIND} more of this kind")
            for (check, severity, sensor), count in self._counts.items()
            if count > _MOST_OF_ONE_KIND
        ]  # fmt: skip
        return self._problems + more
