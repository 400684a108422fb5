"""A recorded drive planned once more: what comes from there, and what is the new one's own."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from carstage.config import parse_config
from carstage.errors import ConfigError
from carstage.plan import Drive, ServerFacts, plan_episodes
from carstage.spec import Command, EpisodeSpec, OpenScenarioSpec, ReplayDriverSpec

FACTS = ServerFacts(maps={"Stage01": 100, "Stage02": 50})
OLD = """
{seed: 5, episodes: 3, duration_s: 1, fps: 8, map: Stage02, vehicles: {count: 4},
timing: {warmup_ticks: 3}, ego: {driver: 'mine:Slalom', color: [1, 2, 3]}}
"""
NEW = "{duration_s: 0.5, fps: 8, weather: WetNoon, ego: {driver: {kind: replay, episode: X}}}"


@pytest.fixture
def drive() -> Drive:
    spec = plan_episodes(parse_config(OLD), FACTS)[2]
    return Drive(spec, tuple(Command(i / 8, 0.0, 0.0, 0, 0, 0, 1) for i in range(spec.steps)))


def again(drive: Drive, text: str = NEW, facts: ServerFacts = FACTS) -> EpisodeSpec:
    (spec,) = plan_episodes(parse_config(text), facts, drive)
    return spec


def test_the_world_is_the_old_one_and_the_rest_is_new(drive: Drive) -> None:
    spec, old = again(drive), drive.spec
    for name in ("map", "seeds", "vehicles", "traffic", "scenario", "timing", "warmup_ticks"):
        assert getattr(spec, name) == getattr(old, name)
    assert (spec.ego.spawn_index, spec.ego.color) == (old.ego.spawn_index, (1, 2, 3))
    assert (spec.weather.preset, old.weather.preset) == ("WetNoon", "ClearNoon")
    assert (spec.steps, spec.index) == (4, 0)
    assert spec.ego.driver == ReplayDriverSpec(old.episode_id, drive.commands[:4])


def test_the_json_form_gives_the_specification_back(drive: Drive) -> None:
    spec = again(drive)
    assert EpisodeSpec.from_json(json.loads(spec.canonical_json())) == spec


def test_episodes_of_other_weather_are_others(drive: Drive) -> None:
    assert again(drive, NEW.replace("WetNoon", "ClearNoon")).episode_id != again(drive).episode_id


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("fps: 8", "fps: 10", "fps: the episode in ego.driver was driven at 8 Hz"),
        ("0.5", "2", "duration_s: the episode in ego.driver was driven for 1 s"),
    ],
)
def test_a_drive_of_another_rate_or_too_short_is_refused(
    drive: Drive, old: str, new: str, message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        again(drive, NEW.replace(old, new))
    assert caught.value.message.startswith(message)


def test_a_sensor_with_a_rate_beside_a_drive_in_step_is_refused(drive: Drive) -> None:
    own = "timing: {sensor_sync: false}, rig: {sensors: [{id: L, kind: lidar, rate_hz: 4}]}}"
    text = NEW.replace("}}}", "}}, " + own)
    with pytest.raises(ConfigError, match=r"^rig\.sensors\[0\]\.rate_hz: in the episode"):
        again(drive, text)
    free = replace(drive.spec, timing=replace(drive.spec.timing, sensor_sync=False))
    assert again(replace(drive, spec=free), text).sensors[0].attributes["sensor_tick"] == "0.25"


def test_a_drive_in_a_file_of_scenario_runner_needs_the_file_again(drive: Drive) -> None:
    played = OpenScenarioSpec("sha256:1", "sha256:2", {})
    drive = replace(drive, spec=replace(drive.spec, scenario=played))
    scenario = "scenario: {kind: openscenario, file: a.xosc%s}, "
    for text in (NEW, NEW.replace("{", "{" + scenario % "", 1)):
        with pytest.raises(ConfigError, match=r"^scenario: scenario_runner played a file"):
            again(drive, text)
    named = NEW.replace("{", "{" + scenario % ", scenario_runner: runner", 1)
    assert again(drive, named).scenario == played


def test_a_drive_of_a_fleet_is_refused() -> None:
    agent = "{name: car2, rig: {sensors: [{id: CAM, kind: rgb}]}}"
    config = parse_config(OLD.replace("episodes: 3", f"episodes: 3, agents: [{agent}]"))
    fleet = Drive(plan_episodes(config, FACTS)[0], (Command(0.0, 0.0, 0.0, 0, 0, 0, 1),) * 8)
    with pytest.raises(ConfigError, match=r"^ego\.driver\.episode: agents drove beside the ego"):
        again(fleet)


def test_a_server_without_its_map_is_refused(drive: Drive) -> None:
    with pytest.raises(ConfigError, match=r"^ego\.driver\.episode: unknown map 'Stage02'"):
        again(drive, facts=ServerFacts(maps={"Stage01": 100}))
