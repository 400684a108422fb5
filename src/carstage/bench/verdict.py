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
        bound: how the true value stands to ``value``, where measuring gave no more than that.
    """

    name: str
    value: float | int | str
    relation: Relation = "=="
    target: float | int | str | None = None
    bound: Literal["<=", ">="] | None = None

    @property
    def ok(self) -> bool:
        """Whether the target is met; NaN meets none, and a bound only what follows from it."""
        if self.target is None:
            return True
        if self.bound is not None and self.bound != self.relation:
            return False
        if self.relation == "==":
            return self.value == self.target
        value, target = float(self.value), float(self.target)
        return value <= target if self.relation == "<=" else value >= target

    def shown(self, form: str) -> str:
        """The value as text, with what is known of it where that is a bound.

        Args:
            form: of a number that is no whole one, such as ``".3f"``.
        """
        text = format(self.value, form) if isinstance(self.value, float) else str(self.value)
        if self.bound is None:
            return text
        return f"at least {text}" if self.bound == ">=" else f"less than can be measured: < {text}"


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
            wanted = "" if figure.target is None else f"  {figure.relation} {figure.target}"
            mark = "" if figure.ok else "  <--"
            lines.append(f"  {figure.name:<{width}}  {figure.shown('.3f')}{wanted}{mark}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def record(self) -> dict[str, Any]:
        """``bench``, ``command``, ``ok``, ``figures`` by name, ``notes``, as JSON has it.

        A figure that is a bound alone has the key ``bound``.
        """
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
                    **({} if figure.bound is None else {"bound": figure.bound}),
                }
                for figure in self.figures
            },
            "notes": list(self.notes),
        }

    def json(self) -> str:
        """:meth:`record` in one line."""
        return json.dumps(self.record())
