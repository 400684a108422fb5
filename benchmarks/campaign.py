"""The verdicts of one benchmark on several things, such as towns."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from carstage.bench.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Campaign:
    """Verdicts by the name of what was judged; has the methods of a ``Verdict``."""

    name: str
    verdicts: Mapping[str, Verdict]

    @property
    def ok(self) -> bool:
        """Whether there is a verdict and all are good."""
        return bool(self.verdicts) and all(verdict.ok for verdict in self.verdicts.values())

    def text(self) -> str:
        """One line for each verdict, the bad ones with what failed."""
        lines = [f"{self.name}: {'ok' if self.ok else 'FAILED'}"]
        for name, verdict in self.verdicts.items():
            bad = [figure.name for figure in verdict.figures if not figure.ok]
            why = ", ".join(bad) if verdict.completed else "did not end"
            lines.append(f"  {name}: {'ok' if verdict.ok else f'FAILED ({why})'}")
        return "\n".join(lines)

    def record(self) -> dict[str, Any]:
        """``bench``, ``ok``, and ``parts`` with each verdict's record by name, as JSON has it."""
        parts = {name: verdict.record() for name, verdict in self.verdicts.items()}
        return {"bench": self.name, "ok": self.ok, "parts": parts}

    def json(self) -> str:
        """:meth:`record` in one line."""
        return json.dumps(self.record())
