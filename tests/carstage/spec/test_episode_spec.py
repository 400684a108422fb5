"""One specification: its JSON form stays what it was, and every field is checked."""

from __future__ import annotations

import json
import re
import tarfile
from pathlib import Path
from typing import Any

import pytest

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.spec import EpisodeSpec, SavedSteps, SpecError, StationarySpec
from carstage.spec.timing import SavedFrames

ROOT = Path(__file__).parents[3]
OLD_DATASET = ROOT / "tests" / "data" / "version-0.1" / "dataset.tar.gz"


def old_plan() -> list[dict[str, Any]]:
    with tarfile.open(OLD_DATASET) as archive:
        (name,) = (name for name in archive.getnames() if name.endswith("/plan.json"))
        file = archive.extractfile(name)
        assert file is not None
        episodes: list[dict[str, Any]] = json.load(file)["episodes"]
    return episodes


@pytest.mark.parametrize("entry", old_plan(), ids=lambda entry: str(entry["episode_id"]))
def test_a_spec_of_version_0_1_keeps_its_json_form_and_its_id(entry: dict[str, Any]) -> None:
    spec = EpisodeSpec.from_json(entry["spec"])
    assert spec.to_json() == entry["spec"]
    assert spec.episode_id == entry["episode_id"]


@pytest.mark.parametrize("word", ["hold", "stationary"])
def test_a_stationary_ego_is_read_by_both_names_and_keeps_its_id(word: str) -> None:
    spec = EpisodeSpec.from_json(bare_spec([bare_sensor("IMU", "imu")], scenario={"kind": word}))
    assert spec.scenario == StationarySpec()
    assert spec.scenario.kind == "stationary"
    assert spec.to_json()["scenario"] == {"kind": "hold"}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"spec_version": 9}, r"spec\.spec_version: 9 is not known"),
        ({"scenario": {"kind": "fly"}}, r"spec\.scenario\.kind: 'fly' is not known"),
        ({"scenario": {"kind": "route", "through": ["A"]}}, r"spec\.scenario\.through\[0\]"),
        ({"labels": {"method": "guess"}}, r"spec\.labels\.method: 'guess' is not known"),
        ({"labels": {"boxes": ["4d"]}}, r"spec\.labels\.boxes\[0\]: '4d' is not known"),
        ({"ground_truth": {"vehicles": 1}}, r"spec\.ground_truth\.vehicles: must be true or"),
        ({"max_distance_m": "far"}, r"spec\.max_distance_m: must be a number"),
        ({"traffic": {"distance_m": [5, 1]}}, r"spec\.traffic\.distance_m: 5 is above 1"),
        ({"ego": {"color": [1, 2, 300]}}, r"spec\.ego\.color: must be three numbers"),
    ],
)
def test_a_bad_field_is_named(change: dict[str, Any], complaint: str) -> None:
    document = bare_spec([bare_sensor("IMU", "imu")], **change)
    with pytest.raises(SpecError, match=complaint):
        EpisodeSpec.from_json(document)


def test_an_episode_without_sensors_is_refused() -> None:
    with pytest.raises(SpecError, match=r"spec\.sensors: is empty"):
        EpisodeSpec.from_json(bare_spec([]))


def test_a_kind_that_is_not_known_is_refused_where_the_kinds_are() -> None:
    document = bare_spec([bare_sensor("S", "sonar")])
    assert EpisodeSpec.from_json(document).sensors[0].kind == "sonar"
    with pytest.raises(SpecError, match=r"spec\.sensors\[0\]\.kind: 'sonar' is not known"):
        EpisodeSpec.from_json(document, kinds=["rgb"])


@pytest.mark.parametrize("every", [1, 2, 3, 7])
def test_saved_steps_are_counted_as_they_are_chosen(every: int) -> None:
    saved = SavedSteps(every)
    for steps in range(1, 30):
        chosen = [k for step in range(steps) if (k := saved.index(step)) is not None]
        assert chosen == list(range(saved.count(steps)))
        assert [saved.index(saved.step(k)) for k in chosen] == chosen
        frames = SavedFrames(saved)
        assert [frames.index(step) for step in range(steps)] == [
            saved.index(step) for step in range(steps)
        ]


def test_no_code_indexes_a_raw_specification() -> None:
    indexed = re.compile(r"""\bspec\[["']""")
    sources = [*(ROOT / "src").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    assert sources
    found = [str(path) for path in sources if indexed.search(path.read_text("utf-8"))]
    assert found == []


def test_the_rule_for_saved_steps_and_the_default_distance_exist_once() -> None:
    rounded_up = re.compile(r"-\(-.*(save_every|saved)")
    distance = re.compile(r"distance_m.*= 80\.0|MAX_DISTANCE_M = 80\.0")
    found: dict[str, list[str]] = {"rule": [], "distance": []}
    for path in sorted((ROOT / "src" / "carstage").rglob("*.py")):
        text = path.read_text("utf-8")
        found["rule"] += [path.name] if rounded_up.search(text) else []
        found["distance"] += [path.name] if distance.search(text) else []
    assert found == {"rule": [], "distance": ["defaults.py"]}
