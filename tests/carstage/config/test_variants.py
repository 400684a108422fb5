"""`variants:` of the configuration, and the specifications that follow from it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from carstage.config import Config, check_config, dump_config, parse_config
from carstage.errors import ConfigError
from carstage.plan import PlanMatcher, ServerFacts, plan_episodes
from carstage.runs.servers import make_server
from carstage.spec import EpisodeSpec, SpecError

FACTS = ServerFacts(maps={"Stage01": 80})
NOON = {"weather": {"choice": "WetNoon"}}
NIGHT = {"weather": {"choice": "ClearNight"}}
CAMERA = {"id": "CAM", "kind": "rgb"}
LOW = {"rig": {"sensors": [{**CAMERA, "pose": {"z": 0.5}}]}}
GRID = {"method": "grid", "repeats": 40_000}


def config(variants: dict[str, Any], **settings: Any) -> Config:
    return parse_config(json.dumps({"map": "Stage01", "variants": variants, **settings}))


def specs(variants: dict[str, Any], **settings: Any) -> tuple[EpisodeSpec, ...]:
    return tuple(plan_episodes(config(variants, **settings), FACTS))


def test_variants_differ_in_what_they_are_given_and_in_nothing_else() -> None:
    first, second = specs({"noon": NOON, "night": NIGHT})
    assert first.weather.preset == "WetNoon"
    assert second.weather.preset == "ClearNight"
    documents = [one.to_json() for one in (first, second)]
    for document in documents:
        del document["weather"], document["variant"]["name"]
    assert documents[0] == documents[1]
    assert first.episode_id != second.episode_id


def test_all_variants_of_an_episode_come_before_the_next_episode() -> None:
    planned = specs({"noon": NOON, "night": NIGHT}, episodes=2)
    named = [(one.index, one.variant.name) for one in planned if one.variant is not None]
    assert named == [(0, "noon"), (0, "night"), (1, "noon"), (1, "night")]
    assert planned[0].seeds == planned[1].seeds != planned[2].seeds


def test_what_variants_have_in_common_is_the_episode_without_them() -> None:
    (plain,) = specs({})
    (low,) = specs({"low": LOW})
    assert low.variant is not None
    assert low.variant.base_id == plain.episode_id
    assert low.sensors[0].pose.z_m == 0.5


def test_a_further_variant_leaves_the_ids_of_others_alone() -> None:
    few = specs({"noon": NOON}, episodes=2)
    more = specs({"night": NIGHT, "noon": NOON}, episodes=2)
    assert {one.episode_id for one in few} < {one.episode_id for one in more}


def test_a_sampled_setting_is_drawn_once_for_all_variants() -> None:
    settings = {"vehicles": {"count": {"range": [2, 60]}}, "weather": ["ClearNoon", "CloudyNoon"]}
    settings["weather"] = {"choice": settings["weather"]}
    planned = specs({"own": NIGHT, "drawn": {}}, episodes=6, **settings)
    pairs = list(zip(planned[::2], planned[1::2], strict=True))
    assert all(one.vehicles.count == other.vehicles.count for one, other in pairs)
    assert len({one.vehicles.count for one, _ in pairs}) > 1
    assert {one.weather.preset for one, _ in pairs} == {"ClearNight"}
    assert {one.weather.preset for _, one in pairs} == {"ClearNoon", "CloudyNoon"}


def test_water_takes_no_grip_where_variants_have_weathers_of_their_own() -> None:
    assert [one.wet_grip for one in specs({"noon": NOON, "dry": {}})] == [False, False]
    assert [one.wet_grip for one in specs({"low": LOW})] == [True]
    assert [one.wet_grip for one in specs({}, server={"wet_grip": "off"})] == [False]
    assert [one.wet_grip for one in specs({"noon": NOON}, server={"kind": "remote"})] == [True]


def test_the_embedded_simulator_is_started_with_the_grip_that_was_planned() -> None:
    with_weathers, without = (make_server(config(one), None) for one in ({"a": NOON}, {"a": LOW}))
    assert "--wet-grip off" in " ".join(vars(with_weathers)["_arguments"])
    assert "--wet-grip" not in vars(without)["_arguments"]


@pytest.mark.parametrize(
    ("variants", "settings", "message"),
    [
        ({"a/b": NOON}, {}, r"variants.a/b: 'a/b' cannot be"),
        ({"a": {"weather": {"choice": "Noon"}}}, {}, r"variants.a.weather.choice"),
        ({"a": {"seed": 4}}, {}, r"variants.a.seed"),
        ({"a": NOON}, {"server": {"wet_grip": "on"}}, r"server.wet_grip: water"),
        (
            {"a": NOON},
            {"timing": {"mode": "async", "sensor_sync": False}},
            r"timing.mode: the frames of variants",
        ),
        ({"a": NOON}, {"ego": {"driver": "keyboard"}}, r"ego.driver.kind: nobody"),
        ({"a": NOON, "b": LOW}, {"episodes": 60_000}, r"variants: 120000 episodes"),
        (
            {"a": NOON, "b": LOW, "c": {}},
            {"campaign": GRID, "vehicles": {"count": {"choice": [1]}}},
            r"campaign.repeats: 120000",
        ),
        (
            {"a": {"weather": {"parameters": {"fog_density": {"range": [0, 9]}}}}},
            {},
            r"variants.a.weather.parameters.fog_density: it is the same in all episodes",
        ),
        (
            {"a": {"rig": {"sensors": [{**CAMERA, "attachment": "spring_arm"}]}}},
            {},
            r"variants.a.rig.sensors\[0\].attachment",
        ),
        ({"a": LOW}, {"labels": {"cameras": ["OTHER"]}}, r"labels.cameras\[0\]"),
    ],
)
def test_variants_that_cannot_be_are_refused_with_their_path(
    variants: dict[str, Any], settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        config(variants, **settings)


def test_what_the_server_lacks_is_refused_with_the_variant_s_path() -> None:
    facts = ServerFacts(
        maps={"Stage01": 80},
        blueprints={"vehicle.tesla.model3": {}, "sensor.other.imu": {}, "walker.pedestrian.1": {}},
    )
    lidar = {"rig": {"sensors": [{"id": "L", "kind": "lidar"}]}}
    imu = {"id": "IMU", "kind": "imu"}
    with pytest.raises(ConfigError, match=r"^variants.a.rig.sensors\[0\].kind: this server has no"):
        plan_episodes(config({"a": lidar}, rig={"sensors": [imu]}), facts)


def test_a_configuration_with_variants_is_written_down_and_read_back() -> None:
    asked = config({"night": NIGHT, "low": LOW})
    assert check_config(dump_config(asked)) == asked


def test_a_specification_with_a_variant_comes_back_from_its_document() -> None:
    for spec in specs({"night": NIGHT, "low": LOW}):
        document = json.loads(spec.canonical_json())
        assert EpisodeSpec.from_json(document) == spec
        document["variant"]["name"] = "a/b"
        with pytest.raises(SpecError, match=r"variant.name: 'a/b'"):
            EpisodeSpec.from_json(document)


def test_recorded_variants_are_found_among_the_planned_ones() -> None:
    asked = config({"night": NIGHT, "low": LOW}, episodes=2)
    matcher = PlanMatcher(asked)
    assert [matcher.number_of(one) for one in plan_episodes(asked, FACTS)] == [0, 1, 2, 3]
    (plain,) = specs({})
    assert matcher.number_of(plain) is None
    assert PlanMatcher(config({})).number_of(specs({"low": LOW})[0]) is None


def test_patches_that_are_not_shown_make_no_pair() -> None:
    patches = "patches: [{target: billboard, pattern: noise}]\n"
    assert set(parse_config(patches).variants) == {"patched", "plain"}
    assert not parse_config(patches + "show_patches: false\n").variants
