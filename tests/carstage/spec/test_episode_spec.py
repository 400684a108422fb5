"""One specification: its JSON form stays what it was, and every field is checked."""

from __future__ import annotations

import json
import math
import re
import tarfile
from pathlib import Path
from typing import Any

import pytest

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.spec import (
    Control,
    EpisodeSpec,
    ReplaySpec,
    SavedSteps,
    SpecError,
    StationarySpec,
    WeatherChange,
    WeatherSpec,
)
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


CHANGES = [{"at_s": at_s, "preset": "WetNoon", "parameters": {}} for at_s in (2.0, 2.0)]


def replay(*poses: list[Any]) -> dict[str, Any]:
    """The section of a replay whose actors have these poses."""
    actors = [{"blueprint": "vehicle.a", "attributes": {}, "poses": of_one} for of_one in poses]
    return {"kind": "replay", "episode_id": "0123456789abcdef", "actors": actors}


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
        ({"ego": {"color": [True, 2, 3]}}, r"spec\.ego\.color: must be three numbers"),
        ({"map_layers": [7]}, r"spec\.map_layers\[0\]: must be a text"),
        ({"max_distance_m": 0}, r"spec\.max_distance_m: must be above 0"),
        ({"max_distance_m": math.inf}, r"spec\.max_distance_m: must be a number"),
        ({"traffic": {"ignore_lights_percent": 101}}, r"ignore_lights_percent: 101 is out of ra"),
        ({"traffic": {"distance_m": [0, "far"]}}, r"spec\.traffic\.distance_m\[1\]: must be a nu"),
        ({"pedestrians": {"running_percent": -1}}, r"running_percent: -1 is out of range"),
        ({"pedestrians": {"in_groups_percent": 101}}, r"in_groups_percent: 101 is out of range"),
        ({"pedestrians": {"wheelchair_percent": -1}}, r"wheelchair_percent: -1 is out of range"),
        ({"weather": {"changes": CHANGES}}, r"spec\.weather\.changes\[1\]\.at_s: must be above 2"),
        ({"scenario": {"kind": "route", "through": []}}, r"spec\.scenario\.through: is empty"),
        ({"scenario": {"kind": "route", "through": [-1]}}, r"through\[0\]: -1 is out of range"),
        ({"scenario": replay()}, r"spec\.scenario\.actors: is empty"),
        ({"scenario": replay([])}, r"actors\[0\]\.poses: 0 poses are not one for each of 1 steps"),
        ({"scenario": replay([[1, 2, 3]])}, r"actors\[0\]\.poses\[0\]: must be 6 numbers"),
        ({"scenario": replay([[0, 0, 0, 0, 0, "a"]])}, r"poses\[0\]: must be 6 numbers"),
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


def test_a_replay_keeps_its_poses() -> None:
    section = replay([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]], [None])
    spec = EpisodeSpec.from_json(bare_spec([bare_sensor("IMU", "imu")], scenario=section))
    assert isinstance(spec.scenario, ReplaySpec)
    assert [actor.poses for actor in spec.scenario.actors] == [((1, 2, 3, 4, 5, 6),), (None,)]
    assert spec.to_json()["scenario"] == section


def test_a_replay_keeps_its_run_up_and_its_driver() -> None:
    section = replay([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    driven = {"run_up": [[0.5, 2.0, 3.0, 4.0, 5.0, 6.0]], "controls": [[0.4, -0.1, 0, 0, 0, 3]]}
    section["actors"][0].update(driven)
    spec = EpisodeSpec.from_json(bare_spec([bare_sensor("IMU", "imu")], scenario=section))
    assert isinstance(spec.scenario, ReplaySpec)
    (actor,) = spec.scenario.actors
    assert actor.controls == (Control(0.4, -0.1, 0, 0, 0, 3),)
    assert EpisodeSpec.from_json(spec.to_json()) == spec
    section["actors"][0]["controls"].append([0] * 6)
    with pytest.raises(SpecError, match="2 controls are not one for each of 1 steps"):
        EpisodeSpec.from_json(bare_spec([bare_sensor("IMU", "imu")], scenario=section))


def sources() -> dict[str, str]:
    """The text of each module that may use a specification, by its path."""
    found = [*(ROOT / "src" / "carstage").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    assert found
    return {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in found}


def test_no_code_indexes_a_raw_specification() -> None:
    """Its JSON form goes into ``from_json`` and comes out of ``to_json``, and that is all."""
    read = re.compile(r"""EpisodeSpec\.from_json\([\w.]+\[["']spec["']\]""")
    raw = re.compile(r"""\bspec\[["']|\bspec\.get\(|\[["']spec["']\]|\.get\(["']spec["']|\.raw\[""")
    found = [path for path, text in sources().items() if raw.search(read.sub("", text))]
    assert found == []


def test_the_rule_for_saved_steps_and_each_shared_default_exist_once() -> None:
    # benchmarks/simulator knows no saved steps: it drives the simulator alone.
    once = {
        r"-\(-[^)\n]*(every|saved)|(//|%)[^#\n]*\bevery\b": ["timing.py"],
        r"distance_m\b[^\n]*= 80|MAX_DISTANCE_M\b[^\n]*= 80": ["defaults.py"],
        r"LIDAR_POINTS\b[^\n]*= 5|lidar_points\b[^\n]*= 5": ["defaults.py"],
        r"QUEUE_(MB|BYTES)\b[^\n]*= *256": ["defaults.py"],
    }
    found = {
        pattern: [path.rsplit("/", 1)[-1] for path, text in sources().items()
                  if re.search(pattern, text) and "/simulator/" not in path]
        for pattern in once
    }  # fmt: skip
    assert found == once


def test_the_preset_of_a_weather_that_changes_is_that_of_the_moment() -> None:
    weather = WeatherSpec(
        "ClearNoon",
        {},
        "auto",
        (
            WeatherChange(2.0, "ClearNoon", {}),
            WeatherChange(4.0, "HardRainNoon", {}),
        ),
    )
    times = (0.0, 1.0, 2.0, 3.0, 4.0, 9.0)
    expected = ("ClearNoon", "ClearNoon", "ClearNoon", None, "HardRainNoon", "HardRainNoon")
    assert tuple(weather.preset_at(time_s) for time_s in times) == expected
