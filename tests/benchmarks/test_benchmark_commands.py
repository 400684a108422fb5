"""``python -m benchmarks``: what the commands print, and their exit codes."""

from __future__ import annotations

import json
from typing import Any

import pytest
from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.registry import BENCHMARKS, app
from carstage.bench.verdict import Figure, Verdict

MEASURED = {
    "overhead": "benchmarks.framework.overhead.measure_overhead",
    "conversion": "benchmarks.framework.conversion.measure_conversion",
    "memory": "benchmarks.framework.memory.measure_memory",
    "frames-check": "benchmarks.framework.frames_check.check_frames",
    "annotation": "benchmarks.framework.annotation.measure_annotation",
}


@pytest.mark.parametrize(("name", "function"), MEASURED.items())
@pytest.mark.parametrize("ok", [True, False])
def test_a_measurement_ends_with_its_verdict_and_one_json_object(
    monkeypatch: pytest.MonkeyPatch, name: str, function: str, ok: bool
) -> None:
    def measure(**settings: Any) -> Verdict:
        settings["progress"](1, 2)
        return Verdict(name, (Figure("x", 1 if ok else 3, "<=", 2),))

    monkeypatch.setattr(function, measure)
    ended = CliRunner().invoke(app, [name, "--json"])
    assert ended.exit_code == (0 if ok else 1)
    printed = json.loads(ended.stdout.splitlines()[-1])
    assert (printed["bench"], printed["ok"]) == (name, ok)
    assert printed["figures"]["x"] == {
        "value": 1 if ok else 3,
        "relation": "<=",
        "target": 2,
        "ok": ok,
    }
    assert "1 of 2" in ended.stderr


def test_the_raw_store_is_handed_on_and_an_unknown_one_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: dict[str, Any] = {}

    def measure(**settings: Any) -> Verdict:
        given.update(settings)
        return Verdict("overhead", ())

    monkeypatch.setattr(MEASURED["overhead"], measure)
    assert CliRunner().invoke(app, ["overhead", "--raw-store", "mmap"]).exit_code == 0
    assert given["raw_store"] == "mmap"
    assert CliRunner().invoke(app, ["overhead", "--raw-store", "tape"]).exit_code == 2


def test_labels_print_their_objects_by_class_and_town_beside_the_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: dict[str, Any] = {}

    def measure(**options: Any) -> tuple[Verdict, dict[str, dict[str, int]]]:
        asked.update(options)
        return Verdict("labels", ()), {"car": {"Stage02": 3}}

    monkeypatch.setattr("benchmarks.framework.labels.measure_labels", measure)
    ended = CliRunner().invoke(app, ["labels", "--towns", "Stage02", "--scenes", "2", "--json"])
    assert ended.exit_code == 0, ended.output
    assert (asked["towns"], asked["scenes"]) == (["Stage02"], 2)
    assert json.loads(ended.stdout.splitlines()[-1])["objects"] == {"car": {"Stage02": 3}}


def test_the_list_says_what_each_shows_and_how_long_it_takes() -> None:
    ended = CliRunner().invoke(app, ["--list"])
    assert ended.exit_code == 0
    lines = ended.stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(BENCHMARKS)
    for line, entry in zip(lines, BENCHMARKS.values(), strict=True):
        assert entry.takes in line
        assert line.endswith(entry.shows)
        assert entry.shows.endswith(".")
