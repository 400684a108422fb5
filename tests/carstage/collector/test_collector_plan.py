"""A plan is checked as a whole before anything is started; complaints name the field."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from carstage.collector.internals.errors import PlanError
from carstage.collector.internals.plan import parse_plan, read_plan
from carstage.spec import EpisodeSpec
from carstage.spec.defaults import QUEUE_BYTES

PlanMaker = Callable[..., dict[str, Any]]


def put(document: Any, path: str, value: Any) -> None:
    *parents, last = [int(part) if part.isdigit() else part for part in path.split("/")]
    for part in parents:
        document = document[part]
    document[last] = value


def test_a_plan_comes_out_as_it_was_written(make_plan: PlanMaker) -> None:
    document = make_plan("one", "two")
    plan = parse_plan(document)
    assert (plan.server.host, plan.server.port, plan.server.timeout_s) == ("127.0.0.1", 2000, 30.0)
    assert plan.queue_bytes == QUEUE_BYTES
    assert plan.sensor_warmup_ticks == 3
    assert [episode.folder for episode in plan.episodes] == ["one", "two"]
    spec = plan.episodes[0].spec
    written = document["episodes"][0]["spec"]
    assert EpisodeSpec.from_json(spec.to_json()) == spec
    assert {name: spec.to_json()[name] for name in ("seeds", "timing", "map")} == {
        name: written[name] for name in ("seeds", "timing", "map")
    }
    assert spec.step_s == 0.1
    assert spec.timing.synchronous
    assert spec.timing.demands_all
    assert spec.weather.begin.parameters == {"cloudiness": 12.5}
    assert [sensor.id for sensor in spec.sensors][:2] == ["CAM", "CAM.depth"]
    assert spec.sensors[0].pose.z_m == 1.7
    assert spec.seeds.spawn == 3


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("mode", "async"),
        ("sensor_sync", False),
        ("on_incomplete", "skip"),
    ],
)
def test_frames_that_may_be_incomplete_by_nature_are_not_waited_for(
    make_plan: PlanMaker, path: str, value: object
) -> None:
    document = make_plan()
    document["episodes"][0]["spec"]["timing"][path] = value
    assert not parse_plan(document).episodes[0].spec.timing.demands_all


SPEC = "episodes/0/spec/"


@pytest.mark.parametrize(
    ("path", "value", "complaint"),
    [
        ("plan_version", 2, "plan_version: 2 is not known"),
        ("server", [], r"server: must be an object"),
        ("server/port", 0, r"server\.port: 0 is out of range"),
        ("server/port", True, r"server\.port: must be a whole number"),
        ("server/timeout_s", 0, r"server\.timeout_s: must be above 0"),
        ("queue_bytes", 0, "queue_bytes: 0 is out of range"),
        ("raw_store", "tape", "raw_store: 'tape' is not known"),
        ("episodes", [], "episodes: is empty"),
        ("episodes/0/attempt", "", r"episodes\[0\]\.attempt: must be a text"),
        (SPEC + "spec_version", 9, r"spec\.spec_version: 9 is not known"),
        (SPEC + "dialect", "0.9", r"spec\.dialect: '0\.9' is not a CARLA version"),
        (SPEC + "fps", -1, r"spec\.fps: must be above 0"),
        (SPEC + "fps", float("nan"), r"spec\.fps: must be a number"),
        (SPEC + "steps", 0, r"spec\.steps: 0 is out of range"),
        (SPEC + "weather/lights", "maybe", r"weather\.lights: 'maybe' is not known"),
        (SPEC + "weather/parameters", {"x": "y"}, r"weather\.parameters\.x: must be a number"),
        (SPEC + "timing/mode", "fast", r"timing\.mode: 'fast' is not known"),
        (SPEC + "timing/max_substeps", 9, r"timing\.max_substeps: 9 sub-steps of 0\.01 s"),
        (SPEC + "timing/sensor_sync", 1, r"timing\.sensor_sync: must be true or false"),
        (SPEC + "seeds", {}, r"spec\.seeds\.traffic_manager: is missing"),
        (SPEC + "seeds/spawn", 2**32, r"seeds\.spawn: 4294967296 is out of range"),
        (SPEC + "scenario/kind", "parade", r"spec\.scenario\.kind: 'parade' is not known"),
        (SPEC + "sensors", [], r"spec\.sensors: is empty"),
        (SPEC + "sensors/1/id", "CAM", r"sensors\[1\]\.id: 'CAM' is taken already"),
        (SPEC + "sensors/0/id", "world", r"sensors\[0\]\.id: 'world' is taken already"),
        (SPEC + "sensors/0/id", "../x", r"sensors\[0\]\.id: stream name"),
        (SPEC + "sensors/0/kind", "sonar", r"sensors\[0\]\.kind: 'sonar' is not known"),
        (SPEC + "sensors/0/pose", {}, r"sensors\[0\]\.pose\.x_m: is missing"),
        (SPEC + "sensors/0/attributes", {"fov": 90}, r"attributes\.fov: must be a text"),
    ],
)
def test_a_bad_field_is_named(
    make_plan: PlanMaker, path: str, value: object, complaint: str
) -> None:
    document = make_plan()
    put(document, path, value)
    with pytest.raises(PlanError, match=complaint) as caught:
        parse_plan(document)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("text", ["", "{", "\udc80"])
def test_a_file_that_is_not_json_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "plan.json"
    path.write_text(text, errors="surrogateescape")
    with pytest.raises(PlanError, match="cannot be read"):
        read_plan(str(path))


def test_a_plan_file_is_read(tmp_path: Path, make_plan: PlanMaker) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(make_plan()))
    assert read_plan(str(path)).episodes[0].episode_id == "episode0"
