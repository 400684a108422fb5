"""The two packages do not import each other, and do not write the same thing twice for it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

SRC = Path(__file__).parents[1] / "src"
PASSAGE_LINES = 6
REASON = re.compile(r"neither\s+(package\s+)?imports\s+the\s+other")
"""What the docstring of a module says that has to repeat a passage of the other package."""


def code_lines(path: Path) -> list[tuple[int, str]]:
    """Numbered lines of code, white space folded; no docstrings, comments, imports, brackets."""
    text = path.read_text("utf-8")
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        imported = isinstance(node, ast.Import | ast.ImportFrom)
        prose = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if imported or prose:
            left_out |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        folded = " ".join(line.split())
        if number in left_out or folded.startswith("#") or len(folded.strip("()[]{},: ")) < 2:
            continue
        lines.append((number, folded))
    return lines


def passages(package: str) -> dict[tuple[str, ...], list[str]]:
    """Every run of six lines of code, with the places where it stands."""
    found: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for path in sorted((SRC / package).rglob("*.py")):
        if REASON.search(ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""):
            continue
        lines = code_lines(path)
        for start in range(len(lines) - PASSAGE_LINES + 1):
            run = lines[start : start + PASSAGE_LINES]
            text = tuple(line for _, line in run)
            found[text].append(f"{path.relative_to(SRC)}:{run[0][0]}")
    return found


def test_no_passage_stands_in_both_packages_without_a_reason() -> None:
    ours, theirs = passages("carstage"), passages("carstage_sim")
    assert ours
    assert theirs
    repeated = {f"{ours[text][0]} and {theirs[text][0]}" for text in ours.keys() & theirs.keys()}
    assert not repeated, "\n".join(sorted(repeated))
