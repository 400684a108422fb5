"""Runs CARLA's smoke tests as they are, one server for each of their files."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from time import monotonic

from benchmarks.simulator.programs.catalogue import SMOKE_FOLDER, SmokeModule, smoke_module
from benchmarks.simulator.programs.running import (
    Outcome,
    Result,
    end_group,
    environment_for,
    lacking,
    last_exception,
    last_text,
    started,
)

SMOKE_PORT = 3654
"""Where the smoke tests look for a server: it stands in their text."""

_PROCESS = Path(__file__).with_name("smoke_process.py")


def smoke_modules(folder: Path) -> Sequence[SmokeModule]:
    """The files of smoke tests in CARLA's ``PythonAPI``, by name."""
    return [smoke_module(path.stem) for path in sorted((folder / SMOKE_FOLDER).glob("test_*.py"))]


def run_module(
    module: SmokeModule, folder: Path, scratch: Path, *, python: str = sys.executable
) -> list[Outcome]:
    """Run the cases of one file against the server on :data:`SMOKE_PORT`.

    Args:
        module: what is run.
        folder: CARLA's ``PythonAPI``.
        scratch: an empty folder, for the home and for results.
        python: interpreter with the client wheel.
    """
    results = scratch / "results.jsonl"
    results.touch()
    tests = scratch / SMOKE_FOLDER
    shutil.copytree(folder / SMOKE_FOLDER, tests)  # some cases write beside their file
    command = [python, str(_PROCESS), f"{tests.name}.{module.name}", str(results)]
    begin_s, late = monotonic(), False
    with (scratch / "output.log").open("w+b") as output:
        process = started(command, tests.parent, environment_for(folder, scratch), output)
        try:
            process.wait(module.seconds)
        except subprocess.TimeoutExpired:
            late = True
        finally:
            end_group(process)
        text = last_text(output)
    rows = [json.loads(line) for line in results.read_text("utf-8").splitlines()]
    outcomes = outcomes_of(rows, f"did not end within {module.seconds:.0f} s" if late else "")
    if outcomes:
        return outcomes
    if missing := lacking(last_exception(text)):
        return [Outcome(module.name, "not run", missing)]
    lines = text.strip().splitlines() or ["it printed nothing"]
    return [Outcome(module.name, "failed", lines[-1][:300], monotonic() - begin_s)]


def outcomes_of(rows: Iterable[Mapping[str, object]], late: str) -> list[Outcome]:
    """What became of each case.

    Args:
        rows: the lines of the file of results.
        late: why a case that began and did not end was cut short; empty: it ended its process.
    """
    found: dict[str, Outcome] = {}
    for row in rows:
        case = str(row["case"])
        if row.get("began"):
            found[case] = Outcome(case, "failed", late or "its process ended")
            continue
        reason, seconds = str(row["reason"]), float(str(row["seconds"]))
        result: Result = "passed" if row["result"] == "passed" else "failed"
        if row["result"] == "not run":
            result = "not run"
        elif result == "failed" and (missing := lacking(reason)):
            result, reason = "not run", missing
        found[case] = Outcome(case, result, reason, seconds)
    return list(found.values())
