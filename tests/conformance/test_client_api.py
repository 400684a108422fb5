"""The check of the client's API: it forgets no name, and the documented table is its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from carstage.releases import KNOWN
from client_api import run
from client_api.entries import Support, entries
from client_api.page import PAGE, api_page
from client_api.since import SINCE, UNTIL, names_of
from client_api.surface import surface
from client_wheels import wheel_python

_SHORT = {"0.9.13": "World.", "0.9.14": "Vehicle.", "0.9.15": "TrafficManager."}
"""What of older wheels is tried; `--only-names ""` plays all, which takes minutes each."""

_NAMES = "from client_api.surface import surface; print(*surface())"


def test_every_name_of_the_client_has_a_trial() -> None:
    assert run.untried() == ()
    assert run.unknown() == ()


def test_a_name_without_a_trial_fails_the_check() -> None:
    verdict = run._verdict([], (*surface(), "Vehicle.fly"), 0)
    assert not verdict.ok
    assert "nobody tries Vehicle.fly" in verdict.notes


def test_a_failed_trial_fails_the_check_and_is_named() -> None:
    verdict = run._verdict(
        [run.Outcome(("Vehicle.open_door",), "no door is seen open")], surface(), 1
    )
    assert not verdict.ok
    assert verdict.notes == ["Vehicle.open_door: no door is seen open"]


def test_every_trial_has_a_sentence() -> None:
    for entry in entries():
        assert entry.sentence.endswith("."), entry.names
        assert entry.support is not Support.LIMITED or len(entry.sentence) > 20


def test_the_documented_table_is_the_one_of_the_check(pytestconfig: pytest.Config) -> None:
    if pytestconfig.getoption("--write-table", default=False):
        PAGE.write_text(api_page(), "utf-8")
    assert PAGE.read_text() == api_page()


@pytest.mark.parametrize("version", ["0.9.13", "0.9.14", "0.9.15"])
def test_what_an_older_wheel_lacks_is_listed(version: str) -> None:
    shown = subprocess.run(
        [wheel_python(version), "-c", _NAMES],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert set(shown.stdout.split()) == names_of(version, surface())


def test_what_came_later_is_in_the_newest_wheel_and_what_went_is_not() -> None:
    groups = {f"{name.rpartition('.')[0] or name}.*" for name in surface()}
    assert {name for names in SINCE.values() for name in names} <= groups | set(surface())
    assert not {name for names in UNTIL.values() for name in names} & set(surface())


@pytest.mark.end_to_end
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "version", [pytest.param(str(v), marks=pytest.mark.py38) for v in KNOWN[:-1]] + [run.NEWEST]
)
def test_every_trial_succeeds_against_a_server(version: str, pytestconfig: pytest.Config) -> None:
    asked = pytestconfig.getoption("--only-names", default=None)
    only = _SHORT.get(version, "") if asked is None else asked
    python = Path(sys.executable) if version == run.NEWEST else wheel_python(version)
    verdict = run.check_api(
        version=version, python=python, server_arguments=("--threads", "1"), only=only
    )
    assert verdict.ok, verdict.text()
