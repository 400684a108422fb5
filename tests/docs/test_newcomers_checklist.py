"""Every file and name in the newcomer's checklist exists."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SECTION = "## A newcomer's checklist"
MODULES = ("carstage", "carstage_sim", "benchmarks")
LEAST_QUESTIONS = 15


def rows() -> list[tuple[str, str]]:
    """Questions and answers."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8").split(SECTION)[1].split("\n## ")[0]
    cells = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    return [(question.strip(), answer.strip()) for question, answer in cells[1:]]


def resolves(dotted: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for name in parts[length:]:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
        return True
    return False


def test_there_are_enough_questions() -> None:
    assert len(rows()) >= LEAST_QUESTIONS


@pytest.mark.parametrize(("question", "answer"), rows(), ids=lambda text: text[:40])
def test_the_answer_names_what_is_there(question: str, answer: str) -> None:
    names = [name for name in re.findall(r"`([^`]+)`", answer) if name != "carla"]
    assert names, question
    for name in names:
        if name.split(".")[0] in MODULES and "/" not in name:
            pytest.importorskip("carla")
            assert resolves(name), name
        else:
            assert (ROOT / name).exists(), name
