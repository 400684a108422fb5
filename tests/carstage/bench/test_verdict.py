"""Verdicts as programs and people read them."""

from __future__ import annotations

import json
from typing import Literal

import pytest

from carstage.bench.verdict import Figure, Relation, Verdict


@pytest.mark.parametrize(
    ("value", "relation", "target", "ok"),
    [
        (3, "<=", 3, True),
        (4, "<=", 3, False),
        (3, ">=", 3, True),
        (2.9, ">=", 3, False),
        ("none", "==", "none", True),
        (1, "==", 0, False),
        (float("nan"), "<=", 3, False),
    ],
)
def test_a_figure_is_held_to_its_target(
    value: float | str, relation: Relation, target: float | str, ok: bool
) -> None:
    assert Figure("x", value, relation, target).ok is ok


@pytest.mark.parametrize(
    ("bound", "relation", "value", "ok"),
    [(">=", ">=", 5.0, True), (">=", ">=", 2.0, False), ("<=", ">=", 5.0, False),
     ("<=", "<=", 2.0, True), (">=", "<=", 2.0, False)],
)  # fmt: skip
def test_a_bound_meets_only_a_target_that_follows_from_it(
    bound: Literal["<=", ">="], relation: Relation, value: float, ok: bool
) -> None:
    figure = Figure("x", value, relation, 3.0, bound)
    assert figure.ok is ok
    assert Verdict("demo", (figure,)).record()["figures"]["x"]["bound"] == bound
    text = Verdict("demo", (figure,)).text()
    assert (f"at least {value:.3f}" if bound == ">=" else f"measured: < {value:.3f}") in text


def test_json_is_one_line_with_figures_beside_targets() -> None:
    verdict = Verdict("demo", (Figure("a", 1.0, "<=", 2.0), Figure("info", "x")), ("why",))
    line = verdict.json()
    assert "\n" not in line
    assert json.loads(line) == {
        "bench": "demo",
        "command": "",
        "ok": True,
        "figures": {
            "a": {"value": 1.0, "relation": "<=", "target": 2.0, "ok": True},
            "info": {"value": "x", "relation": None, "target": None, "ok": True},
        },
        "notes": ["why"],
    }


def test_a_trial_that_did_not_end_is_not_ok() -> None:
    verdict = Verdict("demo", (), ("the client process died",), completed=False)
    assert not verdict.ok
    assert "the client process died" in verdict.text()


def test_text_points_at_what_failed() -> None:
    text = Verdict("demo", (Figure("a", 5.0, "<=", 2.0), Figure("b", 1, "==", 1))).text()
    assert [line.endswith("<--") for line in text.splitlines()] == [False, True, False]


def test_a_verdict_is_bad_when_one_figure_misses_its_target() -> None:
    good, bad = Figure("a", 1.0, "<=", 2.0), Figure("b", float("nan"), "<=", 2.0)
    assert Verdict("x", (good, Figure("info", "word"))).ok
    verdict = Verdict("x", (good, bad))
    assert not verdict.ok
    assert "FAILED" in verdict.text()
    assert verdict.record()["figures"]["b"]["ok"] is False
