"""How commands speak: results on stdout, everything else on stderr, errors as a sentence."""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ParamSpec, cast

import typer

from carstage.errors import BadInputError, CarStageError

INTERRUPTED = 130
_DEBUG = "CARSTAGE_DEBUG"

Parameters = ParamSpec("Parameters")


def enable_debug() -> None:
    """Show tracebacks, here and in processes that are started from here."""
    os.environ[_DEBUG] = "1"


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object as the last line.")]
Debug = Annotated[
    bool,
    typer.Option("--debug", help="Show tracebacks.", callback=lambda on: on and enable_debug()),
]


def result(text: str) -> None:
    """A result, on stdout."""
    typer.echo(text)


def result_json(document: Mapping[str, Any]) -> None:
    """One JSON object as the last line of stdout."""
    typer.echo(json.dumps(document, ensure_ascii=False))


def note(text: str) -> None:
    """Something for the user, on stderr; lost where nobody reads that any more."""
    with unread_is_lost():
        typer.echo(text, err=True)


@contextmanager
def unread_is_lost() -> Iterator[None]:
    """A stretch of writing to stderr, from whose reader nothing else depends.

    A run goes on when the reader of its progress has gone.
    """
    try:
        yield
    except BrokenPipeError:
        _drop(sys.stderr)


def _drop(stream: Any) -> None:
    """Write to nowhere what is still written to a stream."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def confirmed(text: str, question: str) -> bool:
    """Whether the user says yes to a question after a text.

    False where nobody can be asked, or where the input ends instead.

    Raises:
        KeyboardInterrupt: instead of an answer.
    """
    if not (sys.stdin and sys.stdin.isatty() and sys.stderr and sys.stderr.isatty()):
        return False
    note(text)
    try:
        return typer.confirm(question, err=True)
    except typer.Abort as error:  # which of the two it was stands in its context alone
        note("")
        if isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        return False


def folder(address: Path | None) -> Path | None:
    """Callback of a parameter: the folder that was named, also as ``file://``."""
    from carstage.storage import local_folder

    return None if address is None else _parsed(local_folder, address)


def dataset_address(address: Path) -> Path:
    """Callback of a parameter: a folder, or a place in an object store.

    What is no folder passes through the type that the parameter is declared with: commands hand it
    on to what takes either.
    """
    from carstage.storage import dataset_root

    root: Any = _parsed(dataset_root, address)
    return cast("Path", root)


def _parsed(parse: Callable[[Path], Any], address: Path) -> Any:
    try:
        return parse(address)
    except BadInputError as error:
        note(f"Error: {error.message}\n{error.hint}")
        raise typer.Exit(error.exit_code) from error


def command(function: Callable[Parameters, int | None]) -> Callable[Parameters, None]:
    """Make a command of a function that returns its exit code, None for 0.

    Our errors become a sentence and a hint; a traceback is shown with ``--debug`` only. An error
    that is not ours is a bug and says so.
    """

    @functools.wraps(function)
    def wrapped(*args: Parameters.args, **kwargs: Parameters.kwargs) -> None:
        try:
            code = function(*args, **kwargs) or 0
        except CarStageError as error:
            _refuse_if_not_debugging(error)
            note(f"Error: {error.message}")
            if error.hint:
                note(error.hint)
            code = error.exit_code
        except KeyboardInterrupt:
            note("Interrupted.")
            code = INTERRUPTED
        except BrokenPipeError:
            # The reader of stdout has gone, as `| head` does; nothing more can be said there.
            _drop(sys.stdout)
            note("Error: nobody reads standard output any more.")
            note("What was done is done; only the rest of the answer is lost.")
            code = 1
        except OSError as error:
            _refuse_if_not_debugging(error)
            note(
                f"Error: {error.strerror or error}"
                + (f": {error.filename}" if error.filename else "")
            )
            note("Check free space and permissions, then run the same command again.")
            code = 1
        except Exception as error:  # noqa: BLE001 - the last resort of the process
            _refuse_if_not_debugging(error)
            note(f"Error: this is a bug in Car-STAGE: {type(error).__name__}: {error}")
            note("Run the same command with --debug and report what it prints.")
            code = 1
        raise typer.Exit(code)

    return wrapped


def _refuse_if_not_debugging(error: BaseException) -> None:
    if os.environ.get(_DEBUG):
        raise error
