"""``python -m benchmarks NAME [--json]``; ``--list`` shows what there is."""

from __future__ import annotations

import signal
from typing import Annotated, NoReturn

import typer

import benchmarks.framework.commands
import benchmarks.framework.fault_commands
import benchmarks.framework.surroundings_commands
import benchmarks.pictures.commands
import benchmarks.simulator.commands  # noqa: F401 - all register their commands
from benchmarks.registry import BENCHMARKS, app
from carstage.cli.output import enable_debug


def _print_list(wanted: bool) -> None:
    if not wanted:
        return
    width = max(map(len, BENCHMARKS))
    for entry in BENCHMARKS.values():
        typer.echo(f"{entry.name:<{width}}  {entry.takes:>10}  {entry.shows}")
    raise typer.Exit


@app.callback()
def _options(
    listed: Annotated[
        bool,
        typer.Option(
            "--list",
            callback=_print_list,
            is_eager=True,
            help="Say what each benchmark shows and how long it takes on two cores.",
        ),
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
) -> None:
    del listed
    if debug:
        enable_debug()


def _leave(number: int, _: object) -> NoReturn:
    """End by an exception: all that was begun is given back, servers and folders among it."""
    signal.signal(number, signal.SIG_IGN)  # meanwhile
    raise SystemExit(128 + number)


if __name__ == "__main__":
    for ending in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(ending) is not signal.SIG_IGN:
            signal.signal(ending, _leave)
    app(prog_name="python -m benchmarks")
