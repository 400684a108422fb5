"""``carstage bench``: what the commands print, and their exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from carstage.bench.verdict import Figure, Verdict
from carstage.cli.app import app

MEASURED = {
    "overhead": "benchmarks.framework.overhead.measure_overhead",
    "conversion": "benchmarks.framework.conversion.measure_conversion",
    "memory": "benchmarks.framework.memory.measure_memory",
    "frames-check": "benchmarks.framework.frames_check.check_frames",
    "annotation": "benchmarks.framework.annotation.measure_annotation",
    "codecs": "carstage.bench.codecs.measure_codecs",
}


@pytest.mark.parametrize(("name", "function"), MEASURED.items())
@pytest.mark.parametrize("ok", [True, False])
def test_a_measurement_ends_with_its_verdict_and_one_json_object(
    monkeypatch: pytest.MonkeyPatch, name: str, function: str, ok: bool
) -> None:
    def measure(**settings: Any) -> Verdict:
        settings["progress"](1, 2)
        return Verdict(name, f"carstage bench {name}", (Figure("x", 1 if ok else 3, "<=", 2),))

    monkeypatch.setattr(function, measure)
    ended = CliRunner().invoke(app, ["bench", name, "--json"])
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
        return Verdict("overhead", "", ())

    monkeypatch.setattr(MEASURED["overhead"], measure)
    assert CliRunner().invoke(app, ["bench", "overhead", "--raw-store", "mmap"]).exit_code == 0
    assert given["raw_store"] == "mmap"
    assert CliRunner().invoke(app, ["bench", "overhead", "--raw-store", "tape"]).exit_code == 2


def test_labels_print_their_objects_by_class_and_town_beside_the_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: dict[str, Any] = {}

    def measure(**options: Any) -> tuple[Verdict, dict[str, dict[str, int]]]:
        asked.update(options)
        return Verdict("labels", "carstage bench labels", ()), {"car": {"Stage02": 3}}

    monkeypatch.setattr("benchmarks.framework.labels.measure_labels", measure)
    ended = CliRunner().invoke(
        app, ["bench", "labels", "--towns", "Stage02", "--scenes", "2", "--json"]
    )
    assert ended.exit_code == 0, ended.output
    assert (asked["towns"], asked["scenes"]) == (["Stage02"], 2)
    assert json.loads(ended.stdout.splitlines()[-1])["objects"] == {"car": {"Stage02": 3}}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["frames", "--frames", "10"], "--frames: here it is what varies"),
        (["cameras", "--server", "somewhere"], "'somewhere' is no address"),
        (["lidars", "--program", "carstge"], "no program 'carstge'"),
        (["objects", "--value", "-1"], "greater than or equal to 0"),
    ],
)
def test_bad_comparisons_are_refused_before_anything_runs(
    tmp_path: Path, arguments: list[str], message: str
) -> None:
    ended = CliRunner().invoke(app, ["bench", *arguments, "--out", str(tmp_path / "out")])
    assert ended.exit_code == 2
    assert message in ended.stderr
    assert not (tmp_path / "out" / "comparison.json").exists()


def test_a_comparison_may_be_cut_short_and_reports_what_there_is(
    tmp_path: Path,
) -> None:
    asked = ["bench", "cameras", "--preset", "docs", "--minutes", "0", "--out", str(tmp_path)]
    ended = CliRunner().invoke(app, [*asked, "--json"])
    assert ended.exit_code == 0
    assert "120 runs are left" in ended.stderr
    assert json.loads(ended.stdout.splitlines()[-1])["figures"] == {}
    assert (tmp_path / "comparison.html").exists()


@pytest.mark.parametrize(
    "asked",
    [
        "carstage bench cameras --preset docs",
        "carstage bench lidars --preset docs --repeat 7 --value 1 --value 5 --frames 20 "
        "--program carstage --program discard",
        "carstage bench all --preset quick --repeat 2 --program carstage",
    ],
)
def test_a_comparison_says_which_command_repeats_it(tmp_path: Path, asked: str) -> None:
    words = asked.split()[1:]
    CliRunner().invoke(app, [*words, "--minutes", "0", "--out", str(tmp_path)])
    assert json.loads((tmp_path / "comparison.json").read_text())["command"] == asked
