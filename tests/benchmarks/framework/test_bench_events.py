"""The benchmark of events in short: they happen, and what contradicts the record is found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.framework.events import judged, planned, recorded, verdict_on
from benchmarks.registry import app
from carstage.server import EmbeddedServer, Endpoint, allot_ports


def test_a_kind_that_is_none_is_refused_by_name() -> None:
    ended = CliRunner().invoke(app, ["events", "--kind", "earthquake"])
    assert ended.exit_code == 2
    assert "earthquake" in ended.stderr
    assert "cut_in" in ended.stderr


@pytest.fixture(scope="module")
def endpoint() -> Iterator[Endpoint]:
    with EmbeddedServer(port=allot_ports().rpc) as server:
        yield server.endpoint


@pytest.mark.end_to_end
@pytest.mark.xdist_group("bench")
@pytest.mark.parametrize(
    ("kind", "start", "seconds", "otherwise"),
    [
        (
            "hard_braking_leader", 9, 20.0,
            {"deceleration_m_s2": (1.0, "braked at"), "gap_m": (50.0, "m ahead")},
        ),
        (
            "oncoming_overtaker", 25, 6.0,
            {"distance_m": (30.0, "swung out"), "speed_m_s": (20.0, "passed at")},
        ),
        (
            "emergency_vehicle", 25, 10.0,
            {"distance_m": (60.0, "m behind"), "faster_m_s": (2.0, "m/s faster")},
        ),
        (
            "wrong_way_cyclist", 17, 8.0,
            {"trigger_m": (5.0, "m away"), "speed_m_s": (1.0, "rode at")},
        ),
        (
            "red_light_runner", 86, 9.0,
            {"speed_m_s": (4.0, "drove at"), "trigger_m": (-40.0, "entered the junction")},
        ),
        (
            "works_zone", 25, 16.0,
            {"trigger_m": (60.0, "from the barrier"), "speed_m_s": (1.0, "the ego passed at")},
        ),
    ],
)  # fmt: skip
def test_events_happen_as_asked_and_other_wishes_are_contradicted(
    endpoint: Endpoint,
    tmp_path: Path,
    kind: str,
    start: int,
    seconds: float,
    otherwise: dict[str, tuple[Any, str]],
) -> None:
    specs = planned(kind, "Stage01", 1, seconds, [start])
    (log,) = recorded(specs, endpoint, tmp_path / "logs")
    outcome = judged(log)
    verdict = verdict_on(kind, "Stage01", [outcome])
    assert verdict.ok, verdict.text()
    (event,) = log.spec.scenario.events or ()
    asked = event.parameters()
    wrong = judged(log, {**asked, **{name: value for name, (value, _) in otherwise.items()}}).wrong
    for _, words in otherwise.values():
        assert any(words in each for each in wrong), wrong
    absent = replace(outcome, row={**outcome.row, "state": "not placed", "reason": "rain"})
    refused = verdict_on(kind, "Stage01", [absent, outcome])
    assert not refused.ok
    assert "not placed: rain" in refused.notes


@pytest.mark.end_to_end
@pytest.mark.xdist_group("bench")
@pytest.mark.parametrize(
    ("kind", "start", "seconds"),
    [("works_zone", 25, 30.0), ("oncoming_overtaker", 25, 12.0)],
)
def test_events_happen_as_asked_to_an_ego_that_drives_gently(
    endpoint: Endpoint, tmp_path: Path, kind: str, start: int, seconds: float
) -> None:
    specs = planned(kind, "Stage01", 1, seconds, [start], comfort=True)
    assert specs[0].ego.comfort is not None
    (log,) = recorded(specs, endpoint, tmp_path / "logs")
    verdict = verdict_on(kind, "Stage01", [judged(log)])
    assert verdict.ok, verdict.text()
