"""The collector's end of a scenario's program, with programs that only talk."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from carstage.collector.internals.errors import InterruptedByRequestError, SceneError
from carstage.collector.scenario import program
from carstage.collector.scenario.program import ProgramProcess

STEP = '{"event": "step", "ego": 1, "vehicles": [1], "walkers": [], "others": [], "ended": ""}'


def started(monkeypatch: pytest.MonkeyPatch, folder: Path, text: str) -> ProgramProcess:
    path = folder / "program.py"
    path.write_text(f"import json, sys, time\norder = json.loads(sys.stdin.readline())\n{text}")
    monkeypatch.setattr(program, "PROGRAM", str(path))
    return ProgramProcess(sys.executable, {"kind": "test"})


def test_a_program_that_says_why_it_failed_is_quoted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    text = """print('{"event": "failed", "message": "no lane (a.scenic, line 3)"}', flush=True)"""
    process = started(monkeypatch, tmp_path, text)
    with pytest.raises(SceneError, match=r"scenario\.file: .*no lane \(a\.scenic, line 3\)"):
        process.asked(10.0)
    process.end()


def test_a_program_that_dies_is_an_error_at_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    process = started(monkeypatch, tmp_path, "sys.exit(3)")
    begin_s = time.monotonic()
    with pytest.raises(SceneError, match="it ended"):
        process.asked(100.0)
    assert time.monotonic() - begin_s < 50.0
    process.made(7)  # which nobody takes any more
    process.end()


def test_steps_are_asked_for_and_told_in_turn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    text = f"""for line in sys.stdin:
    print('{STEP}'.replace("[]", f"[{{line.strip()}}]", 1), flush=True)
"""
    process = started(monkeypatch, tmp_path, text)
    for frame in (4, 5):
        process.made(frame)
        assert process.asked(10.0)["walkers"] == [frame]
    process.end()
    process.end()


def test_a_program_that_hangs_is_waited_for_no_longer_than_said_and_killed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(program, "END_S", 0.2)
    process = started(monkeypatch, tmp_path, "sys.stdin.readline(); time.sleep(600)")
    with pytest.raises(SceneError, match=r"asked for no step for 0\.3 s"):
        process.asked(0.3)
    process.end()
    assert process._process.returncode is not None


def test_a_request_to_end_is_obeyed_while_the_program_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def check() -> None:
        raise InterruptedByRequestError("SIGTERM")

    process = started(monkeypatch, tmp_path, "sys.stdin.readline()")
    with pytest.raises(InterruptedByRequestError):
        process.asked(100.0, check)
    process.end()


def test_a_program_that_writes_on_and_on_is_held_back_and_ends(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(program, "END_S", 2.0)
    process = started(monkeypatch, tmp_path, f"while True: print('{STEP}', flush=True)")
    for _ in range(100):
        assert process.asked(10.0)["ego"] == 1
    assert process._lines.qsize() <= program.MOST_LINES
    process.end()
    assert process._process.returncode is not None
    assert not process._reader.is_alive()
