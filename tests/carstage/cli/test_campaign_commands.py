"""What the commands say of campaigns and estimates."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from carstage.cli.estimate import _lines
from carstage.runs.estimating import CampaignEstimate

FOUND = CampaignEstimate(
    basis="pilot",
    episodes=400,
    frames=25_000,
    workers=4,
    hours=0.5,
    core_hours=12.345,
    dataset_bytes=11_000_000_000,
    peak_bytes=12_000_000_000,
    money={"cores": 0.617, "storage_month": 0.22, "total": 0.837},
    error={"hours": 0.08},
    notes=("From 3 short episodes on 2 cores of this machine.",),
)


def test_an_estimate_says_how_sure_it_is_where_that_is_known() -> None:
    lines = _lines(FOUND)
    assert lines[0] == "400 episodes, 25000 frames"
    assert "30 minutes ± 8%, with 4 workers" in lines[1]
    assert lines[2] == "core-hours  12.3"
    assert lines[-2] == "money       0.84 (total)"
    assert lines[-1] == FOUND.notes[0]


def test_an_estimate_is_plain_json() -> None:
    document = json.loads(json.dumps(FOUND.to_json()))
    assert document["money"]["total"] == 0.837
    assert document["error"] == {"hours": 0.08}


@pytest.mark.parametrize("command", ["estimate", "campaign"])
def test_the_commands_explain_themselves(command: str) -> None:
    from typer.testing import CliRunner

    from carstage.cli.app import app

    told = CliRunner().invoke(app, [command, "--help"])
    assert told.exit_code == 0
    assert "campaign" in told.output.lower() or "pilot" in told.output.lower()


def test_a_wrong_campaign_ends_with_status_2_before_anything_starts(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from carstage.cli.app import app

    config = tmp_path / "wrong.yaml"
    config.write_text("vehicles: {count: {range: [10, 5000]}}")
    for arguments in (
        ["run", str(config), "--out", str(tmp_path / "out")],
        ["estimate", str(config)],
        ["config", "check", str(config)],
    ):
        ended = CliRunner().invoke(app, arguments)
        assert ended.exit_code == 2, ended.output
        assert "vehicles.count.range[1]: 5000 is too large." in ended.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("price", ["inf", "nan", "-1", "1e300"])
def test_a_price_that_json_cannot_hold_is_refused(price: str, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from carstage.cli.app import app

    config = tmp_path / "config.yaml"
    config.write_text("name: priced\n")
    words = ["estimate", str(config), "--no-pilot", "--json", "--price-gb-month", price]
    ended = CliRunner().invoke(app, words)
    assert (ended.exit_code, ended.stdout) == (2, "")
