"""``carstage bench``: the group of commands, and how each ends."""

from __future__ import annotations

from typing import Any, Protocol

import typer

from carstage.cli.output import note, result, result_json

bench_app = typer.Typer(
    help="Measure what recording costs, next to other programs.", no_args_is_help=True
)


class Judged(Protocol):
    """What a measurement ends with; see ``carstage.bench.verdict.Verdict``."""

    @property
    def ok(self) -> bool:
        """Whether all targets are met."""

    def text(self) -> str:
        """For people."""

    def record(self) -> dict[str, Any]:
        """For programs."""


def report_verdict(verdict: Judged, json: bool, text: str = "", **rows: Any) -> int:
    """Print a verdict and return the exit code.

    Args:
        verdict: what was measured.
        json: whether the last line is the JSON object.
        text: follows the verdict's.
        rows: what the JSON object holds besides the verdict.
    """
    shown = "\n".join(filter(None, (verdict.text(), text)))
    if json:
        note(shown)
        result_json({**verdict.record(), **rows})
    else:
        result(shown)
    return 0 if verdict.ok else 1
