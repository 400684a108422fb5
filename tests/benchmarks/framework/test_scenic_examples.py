"""Scenic's examples: a run that was interrupted goes on."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.framework import scenic_examples
from benchmarks.framework.scenic_examples import PROGRAMS, Tried, measure_scenic_examples, programs

_MODEL = "model scenic.simulators.carla.model\nego = new Car\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    below = tmp_path / PROGRAMS
    below.mkdir(parents=True)
    for name in ("a", "b", "c"):
        (below / f"{name}.scenic").write_text(_MODEL)
    (below / "other.scenic").write_text("model scenic.simulators.gta.model\n")
    return tmp_path


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the programs that are recorded; ``b`` fails with its first seed."""
    names: list[str] = []

    def record(
        folder: Path, path: Path, python: Path, seconds: float, seed: int, work: Path
    ) -> Tried:
        names.append(path.stem)
        failed = path.stem == "b" and seed == 0
        return Tried(path.name, "Town01", "refused" if failed else "recorded", seed, 1, 2.5)

    monkeypatch.setattr(scenic_examples, "_record", record)
    return names


def test_what_was_recorded_is_not_recorded_again(
    folder: Path, tmp_path: Path, recorded: list[str]
) -> None:
    done, chosen = tmp_path / "done.jsonl", programs(folder)
    first, tried = measure_scenic_examples(folder, Path("python"), chosen=chosen[:2], done=done)
    assert first.ok
    assert recorded == ["a", "b", "b"]
    second, again = measure_scenic_examples(folder, Path("python"), chosen=chosen, done=done)
    assert second.ok
    assert recorded == ["a", "b", "b", "c"]
    assert again[:2] == tried
    assert [one.seed for one in again] == [0, 1, 0]


def test_other_seconds_are_recorded_anew(folder: Path, tmp_path: Path, recorded: list[str]) -> None:
    done, chosen = tmp_path / "done.jsonl", programs(folder)[:1]
    for seconds in (2.0, 3.0, 2.0):
        measure_scenic_examples(folder, Path("python"), chosen=chosen, seconds=seconds, done=done)
    assert recorded == ["a", "a"]


def test_a_program_that_failed_is_tried_again(
    folder: Path, tmp_path: Path, recorded: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scenic_examples, "TRIES", 1)
    done, chosen = tmp_path / "done.jsonl", programs(folder)[1:2]
    for _ in range(2):
        verdict, _ = measure_scenic_examples(folder, Path("python"), chosen=chosen, done=done)
        assert not verdict.ok
    assert recorded == ["b", "b"]


def test_the_reason_is_an_error_and_not_the_warning_after_it() -> None:
    said = "NOT valid\nerror: vector_map: lane 1\nwarning: ego_still: the ego moves nowhere"
    assert scenic_examples._reason(said) == "error: vector_map: lane 1"
    assert scenic_examples._reason(f"{said}\nthe program failed: no scene") == "no scene"
    assert scenic_examples._reason("") == ""
