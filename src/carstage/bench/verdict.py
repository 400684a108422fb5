"""Figures with their targets, as text for people and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
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
    """All figures of one measurement.

    Attributes:
        name: of the measurement.
        figures: in the order in which they are shown.
        notes: what to know about them.
        command: what repeats it.
        completed: False when the measurement itself failed; the verdict is bad then.
    """

    name: str
    figures: tuple[Figure, ...]
    notes: Sequence[str] = ()
    command: str = ""
    completed: bool = True

    @property
    def ok(self) -> bool:
        """Whether the measurement ended and every target is met."""
        return self.completed and all(figure.ok for figure in self.figures)

    def text(self) -> str:
        """A table for people."""
        width = max((len(figure.name) for figure in self.figures), default=0)
        lines = [f"{self.name}: {'ok' if self.ok else 'FAILED'}"]
        for figure in self.figures:
            value = f"{figure.value:.3f}" if isinstance(figure.value, float) else figure.value
            wanted = "" if figure.target is None else f"  {figure.relation} {figure.target}"
            lines.append(f"  {figure.name:<{width}}  {value}{wanted}{'' if figure.ok else '  <--'}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def record(self) -> dict[str, Any]:
        """``bench``, ``command``, ``ok``, ``figures`` by name, ``notes``, as JSON has it."""
        return {
            "bench": self.name,
            "command": self.command,
            "ok": self.ok,
            "figures": {
                figure.name: {
                    "value": round(figure.value, 4)
                    if isinstance(figure.value, float)
                    else figure.value,
                    "relation": figure.relation if figure.target is not None else None,
                    "target": figure.target,
                    "ok": figure.ok,
                }
                for figure in self.figures
            },
            "notes": list(self.notes),
        }

    def json(self) -> str:
        """:meth:`record` in one line."""
        return json.dumps(self.record())
