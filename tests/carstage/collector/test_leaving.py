"""The processes with a client end without taking Python apart, which may abort them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """\
import atexit, runpy, sys
atexit.register(print, "Python was taken apart", flush=True)
module, *sys.argv[1:] = sys.argv[1:]
runpy.run_module(module, run_name="__main__")
"""


@pytest.mark.parametrize(
    "module",
    ["carstage.collector", "carstage.collector.following", "carstage.collector.sensor_preview"],
)
def test_it_ends_at_once_with_all_written(module: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, module, str(tmp_path / "no-plan.json")],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    last = json.loads(done.stdout.splitlines()[-1])
    assert last["event"] == "collector_finished"
    assert done.returncode == last["exit_code"]


def test_a_program_that_ends_by_itself_takes_python_apart() -> None:
    """What the test above looks for is there otherwise."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "this"], capture_output=True, text=True, check=True
    )
    assert done.stdout.endswith("Python was taken apart\n")
