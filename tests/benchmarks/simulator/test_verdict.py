"""Verdicts as programs and people read them."""

from __future__ import annotations

import json

import pytest

from benchmarks.simulator.verdict import Campaign, Figure, Relation, Verdict


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


def test_json_is_one_line_with_figures_beside_targets() -> None:
    verdict = Verdict("demo", (Figure("a", 1.0, "<=", 2.0), Figure("info", "x")), ("why",))
    line = verdict.json()
    assert "\n" not in line
    assert json.loads(line) == {
        "check": "demo",
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


def test_a_campaign_is_good_when_all_its_parts_are() -> None:
    good, bad = Verdict("a", (Figure("x", 1, "<=", 2),)), Verdict("b", (Figure("y", 3, "<=", 2),))
    assert Campaign("demo", {"a": good}).ok
    assert not Campaign("demo", {}).ok
    campaign = Campaign("demo", {"a": good, "b": bad})
    assert not campaign.ok
    assert json.loads(campaign.json())["parts"]["b"]["figures"]["y"]["value"] == 3
    assert campaign.text().splitlines()[1:] == ["  a: ok", "  b: FAILED (y)"]
