"""The benchmarks by name: what each shows, how long it takes, and its command."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ParamSpec

import typer

from carstage.cli.bench import Judged, report_verdict
from carstage.cli.output import command

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Measures Car-STAGE itself. What compares it with other programs is `carstage bench`.",
)

Parameters = ParamSpec("Parameters")

Scratch = Annotated[
    Path | None,
    typer.Option(
        "--scratch", help="Existing folder for raw logs, on the disk to be measured.", exists=True
    ),
]


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One line of ``--list``.

    Attributes:
        shows: what it shows, one sentence.
        takes: how long its default form takes on two cores.
    """

    name: str
    shows: str
    takes: str


BENCHMARKS: dict[str, Benchmark] = {}


def benchmark(
    name: str, *, takes: str
) -> Callable[[Callable[Parameters, int]], Callable[Parameters, None]]:
    """Make a command of a function that returns its exit code.

    The first line of its docstring says what it shows. Heavy modules are imported in its body, so
    that starting one benchmark does not import all.
    """

    def add(function: Callable[Parameters, int]) -> Callable[Parameters, None]:
        shows = (function.__doc__ or "").strip().splitlines()[0]
        BENCHMARKS[name] = Benchmark(name, shows, takes)
        added: Callable[Parameters, None] = app.command(name)(command(function))
        return added

    return add


def command_line() -> str:
    """The command that was given, for records of results."""
    return shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]])


def report(verdict: Judged, json: bool, text: str = "", **rows: Any) -> int:
    """Print a verdict, with the command that was given, and return the exit code.

    Args:
        verdict: what was measured.
        json: whether the last line is the JSON object.
        text: follows the verdict's.
        rows: what the JSON object holds besides the verdict.
    """
    return report_verdict(verdict, json, text, command=command_line(), **rows)
