"""``plan.json``: whole specifications of some episodes, ids of many; readers know both."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from carstage.config import check_config, dump_config
from carstage.plan import EpisodePlan, ServerFacts, plan_episodes
from carstage.runs.continuing import OtherSettingsError, refuse_to_mix
from carstage.runs.folder import MOST_WITH_SPECS, RunFolder
from carstage.web.runs.records import read_plan

CONFIG = check_config({"episodes": MOST_WITH_SPECS + 1, "duration_s": 1.0})
ENVIRONMENT = {"carstage": "1"}


@pytest.fixture(scope="module")
def plan() -> EpisodePlan:
    return plan_episodes(CONFIG, ServerFacts(maps={"Stage01": 50}))


def written(out: Path, plan: EpisodePlan) -> dict[str, Any]:
    with RunFolder(out, "run") as folder:
        folder.write_plan(CONFIG, plan, ENVIRONMENT, "1/2")
        document: dict[str, Any] = json.loads((folder.path / "plan.json").read_bytes())
    return document


def test_some_episodes_have_their_specifications(tmp_path: Path, plan: EpisodePlan) -> None:
    document = written(tmp_path, plan[:2])
    assert document["format_version"] == 1
    assert [entry["episode_id"] for entry in document["episodes"]] == list(plan.ids[:2])
    assert [entry.keys() for entry in document["episodes"]] == [{"episode_id", "spec"}] * 2
    assert document["shard"] == "1/2"


def test_many_episodes_have_ids_alone(tmp_path: Path, plan: EpisodePlan) -> None:
    document = written(tmp_path, plan)
    assert document["format_version"] == 2
    assert document["episodes"] == [{"episode_id": one} for one in plan.ids]
    assert document["first_spec"] == json.loads(plan[0].canonical_json())
    assert (document["steps"], document["saved_frames"]) == (10_010, 10_010)


@pytest.mark.parametrize("count", [3, MOST_WITH_SPECS + 1])
def test_the_page_reads_both(tmp_path: Path, plan: EpisodePlan, count: int) -> None:
    written(tmp_path, plan[:count])
    found = read_plan(tmp_path / "runs" / "run" / "plan.json", count)
    assert found is not None
    assert (found.episodes, found.ticks, found.frames) == (count, 10 * count, 10 * count)
    assert [sensor.id for sensor in found.sensors] == ["CAM_FRONT"]


@pytest.mark.parametrize("count", [3, MOST_WITH_SPECS + 1])
def test_a_run_goes_on_with_both(tmp_path: Path, plan: EpisodePlan, count: int) -> None:
    written(tmp_path, plan[:count])
    present = [plan.ids[2]]
    refuse_to_mix(tmp_path, tmp_path, present, plan.ids, dump_config(CONFIG), ENVIRONMENT)
    other = dump_config(check_config({"fps": 20}))
    with pytest.raises(OtherSettingsError, match="fps is 20"):
        refuse_to_mix(tmp_path, tmp_path, present, plan.ids, other, ENVIRONMENT)
