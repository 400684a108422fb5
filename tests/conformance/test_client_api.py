"""The check of the client's API: it forgets no name, and the documented table is its own."""

from __future__ import annotations

import subprocess

import pytest

from client_api import api_page, check_api, run
from client_api.entries import Support, entries
from client_api.page import PAGE
from client_api.since import SINCE
from client_api.surface import surface
from client_wheels import wheel_python

_NAMES = """
import carla
for prefix, module in (("", carla), ("command.", carla.command)):
    for name in dir(module):
        kind = getattr(module, name)
        if isinstance(kind, type) and not name.startswith("_"):
            print(prefix + name)
            for member in vars(kind):
                print(prefix + name + "." + member)
"""


def test_every_name_of_the_client_has_a_trial() -> None:
    assert run.untried() == ()
    assert run.unknown() == ()


def test_a_name_without_a_trial_fails_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "surface", lambda: (*surface(), "Vehicle.fly"))
    verdict = run._verdict([])
    assert not verdict.ok
    assert "nobody tries Vehicle.fly" in verdict.notes


def test_a_failed_trial_fails_the_check_and_is_named() -> None:
    verdict = run._verdict([run.Outcome(("Vehicle.open_door",), "no door is seen open")])
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
    python = wheel_python(version)
    shown = subprocess.run([python, "-c", _NAMES], capture_output=True, text=True, check=True)
    older = set(shown.stdout.split())
    groups = {name.rpartition(".")[0] for name in older}
    later = [names for first, names in SINCE.items() if first > version]
    listed = {name for names in later for name in names}
    lacking = {name for name in surface() if name not in older}
    covered = {
        name
        for name in lacking
        if name in listed or f"{name.rpartition('.')[0] or name}.*" in listed
    }
    assert lacking == covered
    assert all(n.removesuffix(".*") not in (groups if n.endswith(".*") else older) for n in listed)


@pytest.mark.end_to_end
@pytest.mark.timeout(900)
def test_every_trial_succeeds_against_a_server(pytestconfig: pytest.Config) -> None:
    only = pytestconfig.getoption("--only-names", default="")
    verdict = check_api(server_arguments=("--threads", "1"), only=only)
    assert verdict.ok, verdict.text()
