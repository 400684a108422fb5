"""The benchmark of events in short: they happen, and what contradicts the record is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.framework.events import judged, planned, recorded, verdict_on
from benchmarks.registry import app
from carstage.server import EmbeddedServer, allot_ports


def test_a_kind_that_is_none_is_refused_by_name() -> None:
    ended = CliRunner().invoke(app, ["events", "--kind", "earthquake"])
    assert ended.exit_code == 2
    assert "earthquake" in ended.stderr
    assert "cut_in" in ended.stderr


@pytest.mark.end_to_end
@pytest.mark.xdist_group("bench")
def test_leaders_brake_as_asked_and_other_wishes_are_contradicted(tmp_path: Path) -> None:
    specs = planned("hard_braking_leader", "Stage01", 2, 20.0, [9, 100])
    with EmbeddedServer(port=allot_ports().rpc) as server:
        logs = list(recorded(specs, server.endpoint, tmp_path / "logs"))
    outcomes = [judged(log) for log in logs]
    verdict = verdict_on("hard_braking_leader", "Stage01", outcomes)
    assert verdict.ok, verdict.text()
    for log in logs:
        (event,) = log.spec.scenario.events or ()
        asked = {**event.parameters(), "deceleration_m_s2": 1.0, "gap_m": 50.0}
        wrong = judged(log, asked).wrong
        assert any("braked at" in words for words in wrong)
        assert any("m ahead" in words for words in wrong)
    absent = replace(outcomes[0], row={**outcomes[0].row, "state": "not placed", "reason": "rain"})
    refused = verdict_on("hard_braking_leader", "Stage01", [absent, outcomes[1]])
    assert not refused.ok
    assert "not placed: rain" in refused.notes
