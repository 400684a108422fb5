"""Figures beside their targets, as text for people and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

Relation = Literal["<=", ">=", "=="]


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured number or word.

    Attributes:
        name: what it is, with its unit.
        value: what was measured.
        relation, target: what it has to be; no target makes it information only.
    """

    name: str
    value: float | int | str
    relation: Relation = "=="
    target: float | int | str | None = None

    @property
    def ok(self) -> bool:
        """Whether the target is met; NaN meets none."""
        if self.target is None:
            return True
        if self.relation == "==":
            return self.value == self.target
        value, target = float(self.value), float(self.target)
        return value <= target if self.relation == "<=" else value >= target


@dataclass(frozen=True, slots=True)
class Verdict:
    """All figures of one check, and what to know about those that failed.

    Attributes:
        completed: False when the trial itself failed; the verdict is bad then.
    """

    check: str
    figures: tuple[Figure, ...]
    notes: Sequence[str] = ()
    completed: bool = True

    @property
    def ok(self) -> bool:
        """Whether the trial ended and every target is met."""
        return self.completed and all(figure.ok for figure in self.figures)

    def text(self) -> str:
        """A table for people."""
        width = max((len(figure.name) for figure in self.figures), default=0)
        lines = [f"{self.check}: {'ok' if self.ok else 'FAILED'}"]
        for figure in self.figures:
            value = f"{figure.value:.3f}" if isinstance(figure.value, float) else figure.value
            wanted = "" if figure.target is None else f"  {figure.relation} {figure.target}"
            lines.append(f"  {figure.name:<{width}}  {value}{wanted}{'' if figure.ok else '  <--'}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def record(self) -> dict[str, Any]:
        """``check``, ``ok``, ``figures`` by name, ``notes``, as JSON has it."""
        figures = {
            figure.name: {
                "value": figure.value,
                "relation": figure.relation if figure.target is not None else None,
                "target": figure.target,
                "ok": figure.ok,
            }
            for figure in self.figures
        }
        return {
            "check": self.check,
            "ok": self.ok,
            "figures": figures,
            "notes": list(self.notes),
        }

    def json(self) -> str:
        """:meth:`record` in one line."""
        return json.dumps(self.record())


@dataclass(frozen=True, slots=True)
class Campaign:
    """The verdicts of one check on several things, by name."""

    check: str
    verdicts: Mapping[str, Verdict]

    @property
    def ok(self) -> bool:
        """Whether there is a verdict and all are good."""
        return bool(self.verdicts) and all(verdict.ok for verdict in self.verdicts.values())

    def text(self) -> str:
        """One line for each verdict, the bad ones with what failed."""
        lines = [f"{self.check}: {'ok' if self.ok else 'FAILED'}"]
        for name, verdict in self.verdicts.items():
            bad = [figure.name for figure in verdict.figures if not figure.ok]
            why = ", ".join(bad) if verdict.completed else "did not end"
            lines.append(f"  {name}: {'ok' if verdict.ok else f'FAILED ({why})'}")
        return "\n".join(lines)

    def json(self) -> str:
        """One line of JSON: ``check``, ``ok``, ``parts`` with each verdict's record by name."""
        parts = {name: verdict.record() for name, verdict in self.verdicts.items()}
        return json.dumps({"check": self.check, "ok": self.ok, "parts": parts})
