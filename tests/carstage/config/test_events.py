"""Events of a scenario: refused by path, sampled like other settings, planned as they are asked."""

from __future__ import annotations

import json

import pytest

from carstage.config import parse_config
from carstage.errors import ConfigError
from carstage.plan import plan_episodes
from carstage.plan.facts import ServerFacts
from carstage.spec import EVENT_SPECS, EpisodeSpec, SpecError

FACTS = ServerFacts(maps={"Stage01": 214})
EVENTS = "scenario: {kind: autopilot, events: [%s]}"


@pytest.mark.parametrize(
    ("events", "path", "help_"),
    [
        ("{kind: cut_im}", "scenario.events[0].kind: ", "'cut_in'"),
        ("{at_s: 3}", "scenario.events[0].kind: ", "hard_braking_leader"),
        ("{kind: cut_in, gap_m: 1}", "scenario.events[0].gap_m: ", "at least 2"),
        ("{kind: cut_in}, {kind: cut_in, gap: 8}", "scenario.events[1].gap: ", "'gap_m'"),
        (
            "{kind: pedestrian_crosses, side: behind}",
            "scenario.events[0].side: ",
            "Known: left, right",
        ),
        (
            "{kind: pedestrian_crosses, distance_m: 15}",
            "scenario.events[0].trigger_m: ",
            "at most 15",
        ),
        (
            "{kind: stopped_vehicle, trigger_m: 90}",
            "scenario.events[0].trigger_m: ",
            "larger distance_m",
        ),
        (
            "{kind: oncoming_overtaker, speed_m_s: 8, slower_m_s: 7.5}",
            "scenario.events[0].slower_m_s: ",
            "at most 7, or a larger speed_m_s",
        ),
        (
            "{kind: emergency_vehicle, manner: follow, gap_m: 20}",
            "scenario.events[0].gap_m: ",
            "at most 15, or a larger distance_m",
        ),
        (
            "{kind: emergency_vehicle, manner: overtake}",
            "scenario.events[0].manner: ",
            "Known: follow, pass",
        ),
        (
            "{kind: wrong_way_cyclist, trigger_m: 60}",
            "scenario.events[0].trigger_m: ",
            "at most 50",
        ),
        (
            "{kind: works_zone, trigger_m: 60}",
            "scenario.events[0].trigger_m: ",
            "at most 35",
        ),
        (
            "{kind: works_zone, extent: half}",
            "scenario.events[0].extent: ",
            "Known: close, narrow",
        ),
        (
            "{kind: red_light_runner, before_s: -4}",
            "scenario.events[0].before_s: ",
            "at least -3",
        ),
        (
            "{kind: cut_in, gap_m: {range: [8, 80]}}",
            "scenario.events[0].gap_m.range[1]: ",
            "at most 60",
        ),
    ],
)
def test_refusal_begins_with_the_field_and_says_what_to_do(
    events: str, path: str, help_: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        parse_config(EVENTS % events)
    assert refused.value.message.startswith(path)
    assert help_ in f"{refused.value.message} {refused.value.hint}"


@pytest.mark.parametrize("kind", ["stationary", "replay, episode: x"])
def test_only_an_ego_that_drives_meets_events(kind: str) -> None:
    with pytest.raises(ConfigError, match=r"^scenario.events: unknown key"):
        parse_config(f"scenario: {{kind: {kind}, events: [{{kind: cut_in}}]}}")


def test_a_world_that_runs_by_the_clock_has_no_events() -> None:
    with pytest.raises(ConfigError, match=r"^scenario.events: .*\n?") as refused:
        parse_config("timing: {mode: async}\n" + EVENTS % "{kind: cut_in}")
    assert "timing.mode" in str(refused.value.hint)


def test_an_episode_without_events_keeps_the_id_that_it_had() -> None:
    (without,) = plan_episodes(parse_config("map: Stage01"), FACTS)
    (empty,) = plan_episodes(parse_config("map: Stage01\nscenario: {events: []}"), FACTS)
    assert without.to_json()["scenario"] == {"kind": "autopilot"}
    assert empty.episode_id == without.episode_id


def test_parameters_are_drawn_for_each_episode_and_stand_in_its_specification() -> None:
    text = "map: Stage01\nepisodes: 20\n" + EVENTS % (
        "{kind: pedestrian_crosses, speed_m_s: {range: [1, 2]}, side: {choice: [left, right]}}"
    )
    specs = list(plan_episodes(parse_config(text), FACTS))
    events = [spec.to_json()["scenario"]["events"][0] for spec in specs]
    assert {event["side"] for event in events} == {"left", "right"}
    speeds = [event["speed_m_s"] for event in events]
    assert len(set(speeds)) == 20
    assert 1.0 <= min(speeds) < max(speeds) <= 2.0
    again = [EpisodeSpec.from_json(json.loads(spec.canonical_json())) for spec in specs]
    assert again == specs


@pytest.mark.parametrize("kind", sorted(EVENT_SPECS))
def test_a_specification_by_hand_is_checked_too(kind: str) -> None:
    text = "map: Stage01\n" + EVENTS % f"{{kind: {kind}}}"
    (spec,) = plan_episodes(parse_config(text), FACTS)
    document = spec.to_json()
    assert EpisodeSpec.from_json(document) == spec
    document["scenario"]["events"][0]["at_s"] = -1.0
    with pytest.raises(SpecError, match=r"^spec.scenario.events\[0\].at_s: -1 is out of range"):
        EpisodeSpec.from_json(document)
    document["scenario"]["events"][0]["kind"] = "earthquake"
    with pytest.raises(SpecError, match=r"^spec.scenario.events\[0\].kind: 'earthquake'"):
        EpisodeSpec.from_json(document)
