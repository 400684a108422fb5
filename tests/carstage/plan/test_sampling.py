"""Campaigns: what an episode gets follows from its index, and equals the fixed configuration."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage.config import Config, check_config, dump_config, parse_config
from carstage.config.dimensions import dimensions
from carstage.config.paths import place_value
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, Shard, plan_episodes
from carstage.plan.sampling import Sampling, value_at

FACTS = ServerFacts(maps={"Stage01": 100, "Stage02": 50, "Stage03": 20})
SETTINGS = """
vehicles: {count: {range: [10, 50]}}
duration_s: {choice: [2, 4], weights: [3, 1]}
weather:
  choice: [ClearNoon, WetNoon, ClearNight]
  parameters: {fog_density: {normal: [20, 9], min: 0, max: 50}}
map: {choice: [Stage01, Stage02]}
max_distance_m: {range: [50, 100]}
"""
METHODS = {
    "random": "{method: random}",
    "latin_hypercube": "{method: latin_hypercube, block: 7}",
    "stratified": "{method: stratified, strata: [map.choice, weather.choice]}",
}
GRID = """
vehicles: {count: {range: [10, 50], steps: 5}}
map: {choice: [Stage01, Stage02]}
fps: {choice: [10, 20]}
campaign: {method: grid}
"""


def campaign(method: str, episodes: int = 20, seed: int = 7) -> Config:
    return parse_config(
        f"{SETTINGS}\nseed: {seed}\nepisodes: {episodes}\ncampaign: {METHODS[method]}"
    )


@pytest.mark.parametrize("method", METHODS)
@given(seed=st.integers(0, 2**63 - 1), few=st.integers(1, 20), more=st.integers(1, 20))
@settings(max_examples=15, deadline=None)
def test_more_episodes_do_not_change_the_first_ones(
    method: str, seed: int, few: int, more: int
) -> None:
    first = plan_episodes(campaign(method, few, seed), FACTS)
    assert plan_episodes(campaign(method, few + more, seed), FACTS).ids[:few] == first.ids


@pytest.mark.parametrize("method", METHODS)
def test_an_episode_equals_that_of_the_fixed_configuration(method: str) -> None:
    config = campaign(method)
    plan, sampling = plan_episodes(config, FACTS), Sampling(config)
    for index in (0, 5, 19):
        document = dump_config(config)
        del document["campaign"]
        for path, value in sampling.values(index).items():
            place_value(document, path, value)
        fixed = check_config(document)
        assert fixed.campaign is None
        assert plan_episodes(fixed, FACTS)[index] == plan[index]


@pytest.mark.parametrize("method", METHODS)
def test_shares_of_a_campaign_are_its_episodes(method: str) -> None:
    plan = plan_episodes(campaign(method), FACTS)
    shared = [one for number in (1, 2, 3) for one in plan[Shard(number, 3).places].ids]
    assert sorted(shared) == sorted(plan.ids)


@given(
    seed=st.integers(0, 2**63 - 1),
    index=st.integers(0, 10**5),
    unit=st.floats(0.0, 1.0, exclude_max=True),
)
@settings(deadline=None)
def test_values_are_within_their_bounds(seed: int, index: int, unit: float) -> None:
    sampling = Sampling(campaign("random", seed=seed))
    for values in (
        sampling.values(index),
        {one.path: value_at(one, unit) for one in sampling.dimensions},
    ):
        assert 10 <= values["vehicles", "count"] <= 50
        assert isinstance(values["vehicles", "count"], int)
        assert values[("duration_s",)] in (2, 4)
        assert 0.0 <= values["weather", "parameters", "fog_density"] <= 50.0
        assert 50.0 <= values[("max_distance_m",)] <= 100.0


def test_another_sampled_setting_moves_no_other() -> None:
    more = parse_config(SETTINGS + "\nmin_lidar_points: {range: [0, 9]}")
    for index in range(5):
        values = Sampling(more).values(index)
        for path, value in Sampling(parse_config(SETTINGS)).values(index).items():
            assert values[path] == value


def test_values_are_spread_as_they_should() -> None:
    sampling = Sampling(campaign("random"))
    drawn = [sampling.values(index) for index in range(2000)]
    counts = Counter(one[("duration_s",)] for one in drawn)
    assert 0.70 < counts[2] / 2000 < 0.80
    assert set(Counter(one["vehicles", "count"] for one in drawn)) == set(range(10, 51))
    fog = [one["weather", "parameters", "fog_density"] for one in drawn]
    assert 19.5 < sum(fog) / 2000 < 21.0
    assert 0.60 < sum(11 < one < 29 for one in fog) / 2000 < 0.75


def test_each_block_of_a_latin_hypercube_covers_each_range_evenly() -> None:
    config = parse_config(
        "{max_distance_m: {range: [0.5, 7.5]}, vehicles: {count: {range: [0, 6]}}, "
        "campaign: {method: latin_hypercube, block: 7}}"
    )
    sampling = Sampling(config)
    orders = set()
    for block in range(20):
        drawn = [sampling.values(block * 7 + position) for position in range(7)]
        counts = tuple(one["vehicles", "count"] for one in drawn)
        assert sorted(counts) == list(range(7))
        assert sorted(int(one[("max_distance_m",)] - 0.5) for one in drawn) == list(range(7))
        orders.add(counts)
    assert len(orders) > 15


def test_strata_have_equal_shares_at_any_time() -> None:
    plan = plan_episodes(campaign("stratified", 60), FACTS)
    for length in (6, 12, 36, 60):
        cells = Counter((spec.map, spec.weather.preset) for spec in plan[:length])
        assert set(cells.values()) == {length // 6}
    assert len({spec.vehicles.count for spec in plan}) > 10


def test_a_grid_has_every_combination_once_and_then_again() -> None:
    config = parse_config(GRID)
    assert config.episodes == 20
    plan = plan_episodes(config.model_copy(update={"episodes": 30}), FACTS)
    cells = [(spec.fps, spec.map, spec.vehicles.count) for spec in plan]
    assert len(set(cells[:20])) == 20
    assert cells[20:] == cells[:10]
    assert {count for _, _, count in cells} == {10, 20, 30, 40, 50}
    assert len(set(plan.ids)) == 30


def test_values_that_do_not_go_together_name_the_episode() -> None:
    text = (
        "{episodes: 50, fps: {choice: [20, 10]}, timing: {substepping: {"
        "max_substep_delta_time_s: 0.01, max_substeps: {choice: [10, 5]}}}}"
    )
    with pytest.raises(ConfigError, match=r"timing\.substepping: .* in episode \d+ .*fps = 10"):
        plan_episodes(parse_config(text), FACTS)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("map: {choice: [Stage01, Stage09]}", r"^map\.choice\[1\]: unknown map 'Stage09'"),
        ("ego: {blueprint: {choice: [vehicle.a.b, vehicle.x.y]}}", r"^ego\.blueprint\.choice\[1\]"),
        ("ego: {spawn: {range: [0, 100]}}", r"^ego\.spawn: Stage01 has no spawn point 100"),
    ],
)
def test_what_the_server_lacks_is_refused_before_anything_is_drawn(text: str, message: str) -> None:
    blueprints = {"vehicle.a.b": {}, "walker.a": {}, "sensor.other.imu": {}}
    facts = ServerFacts(maps=FACTS.maps, blueprints=blueprints if "vehicle" in text else {})
    rest = "rig: {sensors: [{id: I, kind: imu}]}\npedestrians: {filter: walker.a}\nepisodes: 2000"
    with pytest.raises(ConfigError, match=message):
        plan_episodes(parse_config(f"{text}\n{rest}"), facts)


def test_a_setting_that_is_fixed_is_no_dimension() -> None:
    assert dimensions(parse_config("vehicles: {count: 3}")) == ()
    assert Sampling(parse_config("vehicles: {count: 3}")).values(5) == {}
