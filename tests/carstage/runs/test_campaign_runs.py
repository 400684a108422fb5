"""Whole runs of a campaign: quotas end it, the report tells of it, a fixed run has its bytes."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from driving import SMALL, carstage, differing, hashes, status
from sites import open_site

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]

CAMPAIGN = """
name: sampled
episodes: 6
duration_s: {choice: [0.3, 0.4]}
image_size: [96, 54]
vehicles: {count: {range: [3, 6]}}
pedestrians: {count: 3}
weather: {choice: [ClearNight, ClearNoon]}
conversion: {workers: 1}
server: {self_test: "off"}
campaign:
  method: stratified
  strata: [weather.choice]
  quotas: [{name: night, frames: 1, where: {objects: vehicle, sun_altitude_below_deg: 0}}]
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("campaign") / "campaign.yaml"
    path.write_text(CAMPAIGN)
    return path


@pytest.fixture(scope="module")
def recorded_until_enough(
    config: Path, home: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    out = tmp_path_factory.mktemp("enough") / "dataset"
    ended = carstage(["run", str(config), "--out", str(out), "--json"], home)
    assert ended.code == 0, ended.stderr
    result = last_line(ended.stdout)
    assert "All quotas are met" in ended.stderr
    # One episode has what is wanted; those that were under way meanwhile are committed, too.
    assert 1 <= result["episodes"]["committed"] == result["episodes"]["total"] < 6
    return out


def last_line(stdout: str) -> Any:
    return json.loads(stdout.splitlines()[-1])


def test_a_run_that_has_enough_begins_no_further_episode(recorded_until_enough: Path) -> None:
    assert status(recorded_until_enough)["state"] == "done"
    assert "All quotas are met" in status(recorded_until_enough)["message"]


def test_the_same_command_again_counts_what_is_there_and_records_nothing(
    recorded_until_enough: Path, config: Path, home: Path
) -> None:
    before = hashes(recorded_until_enough)
    out = ["--out", str(recorded_until_enough), "--json"]
    again = carstage(["run", str(config), *out], home)
    assert again.code == 0, again.stderr
    counts = last_line(again.stdout)["episodes"]
    assert counts == {"total": len(before), "committed": 0, "skipped": len(before), "failed": 0}
    assert hashes(recorded_until_enough) == before


def test_the_report_says_what_is_recorded(
    recorded_until_enough: Path, config: Path, home: Path
) -> None:
    count = len(hashes(recorded_until_enough))
    arguments = ["campaign", "report", str(recorded_until_enough), str(config)]
    state = last_line(carstage([*arguments, "--json"], home).stdout)
    assert (state["committed"], state["planned"], state["others"]) == (count, 6, 0)
    assert state["quotas"][0]["met"]
    assert state["dimensions"]["weather.choice"][0] == {
        "label": "ClearNight",
        "planned": 3,
        "episodes": (count + 1) // 2,
    }
    for bins in state["dimensions"].values():
        assert sum(one["episodes"] for one in bins) == count
        assert sum(one["planned"] for one in bins) == 6
    told = carstage(arguments, home).stdout
    assert f"sampled: {count} of 6 episodes are committed." in told
    assert "quota night: " in told
    # A configuration of another seed has none of them.
    other = last_line(carstage([*arguments, "--set", "seed=8", "--json"], home).stdout)
    assert (other["committed"], other["others"]) == (0, count)


def test_the_page_shows_what_the_report_says_and_its_command(
    recorded_until_enough: Path, config: Path, home: Path
) -> None:
    with open_site(recorded_until_enough.parent) as client:
        answer = client.get(f"/api/datasets/{recorded_until_enough.name}/campaigns").json()
        (shown,) = answer["campaigns"]
        asked = {"do": "campaign-report", "run_id": shown["run_id"]}
        text = client.post("/api/command", json={"command": asked}).json()["text"]
    command, _, document = text.partition(" <<'CONFIG'\n")
    words = shlex.split(command)[1:]
    assert words == ["campaign", "report", str(recorded_until_enough), "-"]
    told = subprocess.run(
        [sys.executable, "-m", "carstage.cli", *words, "--json"],
        input=document.removesuffix("CONFIG"),
        capture_output=True,
        text=True,
        check=True,
    )
    state = last_line(told.stdout)
    assert answer["problems"] == []
    axes = {axis["path"]: axis["bins"] for axis in shown.pop("axes")}
    assert axes == state.pop("dimensions")
    del shown["run_id"]
    assert shown == state


def test_an_episode_has_the_bytes_of_the_fixed_configuration(
    recorded_until_enough: Path, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "fixed"
    specs = sorted(
        (json.loads(path.read_bytes())["spec"] for path in recorded_until_enough.glob(
            "episodes/*/*/episode.json"
        )),
        key=lambda one: int(one["index"]),
    )  # fmt: skip
    first = specs[0]
    fixed = tmp_path / "fixed.yaml"
    fixed.write_text(SMALL.replace("rig: {preset: demo}", "").replace("name: small", "name: fixed"))
    changes = {
        "duration_s": first["steps"] / first["fps"],
        "vehicles.count": first["vehicles"]["count"],
        "weather": first["weather"]["preset"],
    }
    settings = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    ended = carstage(["run", str(fixed), "--out", str(out), *settings], home)
    assert ended.code == 0, ended.stderr
    (episode_id,) = hashes(out)
    others = {path.partition("/")[0] for path in differing(recorded_until_enough, out)}
    assert episode_id in hashes(recorded_until_enough)
    assert episode_id not in others
