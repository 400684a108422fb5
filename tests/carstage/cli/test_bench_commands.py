"""``carstage bench``: what the commands print, and their exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from carstage.bench.verdict import Figure, Verdict
from carstage.cli.app import app


@pytest.mark.parametrize("ok", [True, False])
def test_a_measurement_ends_with_its_verdict_and_one_json_object(
    monkeypatch: pytest.MonkeyPatch, ok: bool
) -> None:
    def measure(**settings: Any) -> Verdict:
        settings["progress"](1, 2)
        return Verdict("codecs", (Figure("x", 1 if ok else 3, "<=", 2),))

    monkeypatch.setattr("carstage.bench.codecs.measure_codecs", measure)
    ended = CliRunner().invoke(app, ["bench", "codecs", "--json"])
    assert ended.exit_code == (0 if ok else 1)
    printed = json.loads(ended.stdout.splitlines()[-1])
    assert (printed["bench"], printed["ok"]) == ("codecs", ok)
    assert printed["figures"]["x"] == {
        "value": 1 if ok else 3,
        "relation": "<=",
        "target": 2,
        "ok": ok,
    }
    assert "1 of 2" in ended.stderr


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
