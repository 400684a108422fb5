"""``python -m benchmarks``: what the commands print, and their exit codes."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer.main
from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.registry import BENCHMARKS, app
from carstage.bench.verdict import Figure, Verdict
from carstage.errors import ServerError

ROOT = Path(__file__).parents[2]
LATER = ("carla", "numba", "numpy", "benchmarks.framework.overhead", "benchmarks.simulator.traffic")
"""Modules that only some benchmarks need."""

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
    monkeypatch.setattr("sys.argv", ["benchmarks", name, "--json"])
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
    assert printed["command"] == f"python -m benchmarks {name} --json"
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


@pytest.mark.parametrize("ok", [True, False])
@pytest.mark.parametrize(
    ("name", "function"),
    {
        "budget": "benchmarks.simulator.budget.check_budget",
        "server-memory": "benchmarks.simulator.memory.check_memory",
        "conformance": "benchmarks.simulator.conformance.check_conformance",
    }.items(),
)
def test_a_check_of_the_simulator_ends_alike(
    monkeypatch: pytest.MonkeyPatch, name: str, function: str, ok: bool
) -> None:
    monkeypatch.setattr(function, lambda *_, **__: Verdict(name, (Figure("x", int(ok), "==", 1),)))
    ended = CliRunner().invoke(app, [name, "--json"])
    assert ended.exit_code == (0 if ok else 1)
    printed = json.loads(ended.stdout.splitlines()[-1])
    assert (printed["bench"], printed["ok"]) == (name, ok)


def test_a_server_that_does_not_start_is_a_bad_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    def check(**_: Any) -> Verdict:
        raise ServerError("The embedded simulator ended.")

    monkeypatch.setattr("benchmarks.simulator.budget.check_budget", check)
    ended = CliRunner().invoke(app, ["budget", "--json"])
    assert ended.exit_code == 1
    printed = json.loads(ended.stdout.splitlines()[-1])
    assert (printed["ok"], printed["notes"]) == (False, ["The embedded simulator ended."])


def test_the_list_needs_none_of_the_benchmarks() -> None:
    program = f"import sys, benchmarks.__main__; print(*{{*sys.modules}} & {{*{LATER}}})"
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []


def written_commands() -> set[str]:
    """Commands in documents and in recorded results; ``a|b`` stands for two."""
    paths = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    paths += [*(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks/results").glob("*.json")]
    found = set()
    for path in paths:
        for names, options in re.findall(
            r"python -m benchmarks ([a-z][a-z|-]*)([^`#\"(;\n]*)", path.read_text("utf-8")
        ):
            found |= {f"{name}{options}".strip() for name in names.split("|")}
    return found


@pytest.mark.parametrize("command", sorted(written_commands()))
def test_a_written_command_can_be_given(command: str) -> None:
    name, *words = shlex.split(command)
    words = ["1" if re.fullmatch("[A-Z]|SEED", word) else word for word in words]
    group = typer.main.get_command(app)
    required = ["python"] if name in ("demo-against", "same-bytes") and not words else []
    group.commands[name].make_context(name, [*words, *required])  # refuses what it does not know


def test_every_result_is_of_a_command_that_there_is() -> None:
    for path in (ROOT / "benchmarks" / "results").glob("*.json"):
        command = json.loads(path.read_text("utf-8"))["command"]
        begins = ("python -m benchmarks ", "carstage bench ", "python .ci/pip_install.py")
        assert command.startswith(begins), path.name
