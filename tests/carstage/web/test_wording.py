"""Errors in the words of the page: titles of fields, no options of commands, no keys."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import carstage
from carstage.web.messages import FieldProblem
from carstage.web.wording import page_words, problem_in_page_words
from sites import FakeRun, Site, open_site

ROOT = Path(carstage.__file__).parent
RAISED = re.compile(r"(Error|problem|_refusal)$")
#: What never reaches the page: terminals, measurements, catalogs, and how the page itself starts.
ELSEWHERE = ("cli/", "bench/", "catalog/", "web/serving.py", "config/loading.py")
OPTION = re.compile(r"(?<![\w-])--[a-z]|\bcarstage [a-z]+\b(?!')|\bpython -m ")
KEY = re.compile(r"\b(server|ego|timing|labels|supervision|conversion|scenario)\.[a-z]+_?[a-z]")


def texts(arguments: list[ast.expr]) -> Iterator[str]:
    """Literal texts of a call, with a word in each gap."""
    for argument in arguments:
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
            yield argument.value
        elif isinstance(argument, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else "Xy"
                for part in argument.values
            )


def hints() -> Iterator[tuple[str, str]]:
    """Messages and hints of all errors that the page may show, with their places."""
    for path in sorted(ROOT.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if name.startswith(ELSEWHERE):
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and RAISED.search(ast.unparse(node.func)):
                for position, text in enumerate(texts(node.args[:2])):
                    if position == 1 and " " in text:
                        yield f"{name}:{node.lineno}", text


def test_no_hint_that_reaches_the_page_speaks_of_options_or_keys() -> None:
    found = list(hints())
    assert len(found) > 150
    assert any(OPTION.search(hint) for _, hint in found), "the scan sees none any more"
    wrong = [
        f"{place}: {said}"
        for place, hint in found
        if OPTION.search(said := page_words(hint, hint=True)) or KEY.search(said)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("Choose another --out or change the folder's permissions.",
         "Choose another destination or change the folder's permissions."),
        ("Name another --out, or add --append to record into it all the same.",
         "Name another destination, or record into it all the same."),
        ("Check server.host and server.port, and that the server runs.",
         "Check “Host” and “Port”, and that the server runs."),
        ("Use save_every, or set timing.sensor_sync to false.",
         "Use “Save every (steps)”, or set “Sensors in step” to false."),
        ("It has 3, counted from 0.", "It has 3, counted from 0."),
        ("Compare with the output of `python -m carstage_sim --describe`.", ""),
        ("Is it CARLA 0.9.13 or later?", "Is it CARLA 0.9.13 or later?"),
        ("Look at vehicle.tesla.model3 and sensor_poses.parquet.",
         "Look at vehicle.tesla.model3 and sensor_poses.parquet."),
    ],
)  # fmt: skip
def test_hints_name_what_the_page_has(said: str, shown: str) -> None:
    assert page_words(said, hint=True) == shown


def test_a_message_that_begins_with_a_key_begins_with_the_title() -> None:
    assert page_words("server.port: port 2000 on here is in use.").startswith("Port: port 2000")
    assert page_words("output: the run needs 5 MB.") == "The run needs 5 MB."
    assert page_words("ConfigError: it is wrong.") == "ConfigError: it is wrong."


def test_the_path_of_a_problem_stays() -> None:
    problem = FieldProblem(path=["timing", "sensor_sync"], message="wrong.", hint="--out")
    assert problem_in_page_words(problem).path == ["timing", "sensor_sync"]
    assert problem_in_page_words(problem).hint == ""


def test_the_form_is_told_titles_and_the_text_view_keys(site: Site, demo: dict[str, Any]) -> None:
    sensors = [dict(sensor) for sensor in demo["rig"]["sensors"]]
    sensors[0]["rate_hz"] = demo["fps"] / 2
    wrong = {**demo, "rig": {"sensors": sensors}}
    checked = site.client.post("/api/config/check", json={"config": wrong}).json()
    assert "“Save every (steps)”" in checked["errors"][0]["hint"]
    assert "save_every" not in checked["errors"][0]["hint"]
    text = site.client.post("/api/config/export", json={"config": wrong, "format": "yaml"}).json()
    read = site.client.post("/api/config/import", json={"text": text["text"], "format": "yaml"})
    assert "save_every" in read.json()["errors"][0]["hint"], "there keys are what one sees"


def test_the_error_of_a_run_is_told_without_options(tmp_path: Path, fake_run: FakeRun) -> None:
    fake_run.say(
        state="failed", message="output: the disk is full. Choose another --out, and try again."
    )
    fake_run.end()
    with open_site(tmp_path / "datasets") as client:
        (run,) = client.get("/api/runs").json()["runs"]
    assert run["message"] == "The disk is full. Choose another destination, and try again."
