"""A plan is a sequence of specifications that it makes when they are asked for."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from carstage.config import parse_config
from carstage.plan import EpisodePlan, ServerFacts, estimate_run, plan_episodes

FACTS = ServerFacts(maps={"Stage01": 100, "Stage02": 50})
TEXT = "{episodes: 9, map: {random_from: [all]}, weather: {random_from: [all]}}"


@pytest.fixture
def plan() -> EpisodePlan:
    return plan_episodes(parse_config(TEXT), FACTS)


def test_the_ids_it_knows_are_those_of_its_specifications(plan: EpisodePlan) -> None:
    assert plan.ids == tuple(replace(spec).episode_id for spec in plan)


def test_specifications_are_the_same_in_any_order(plan: EpisodePlan) -> None:
    backward = [plan[position] for position in reversed(range(len(plan)))]
    assert list(reversed(backward)) == list(plan)
    assert plan[-1] == plan[8]


def test_parts_of_it_are_plans(plan: EpisodePlan) -> None:
    part = plan[1::3]
    assert isinstance(part, EpisodePlan)
    assert list(part) == list(plan)[1::3]
    assert part.frames == sum(spec.saved_frames for spec in part)
    rest = plan.without({plan.ids[0], plan.ids[4], "of another plan"})
    assert rest.ids == plan.ids[1:4] + plan.ids[5:]
    assert rest.indices.tolist() == [1, 2, 3, 5, 6, 7, 8]
    assert rest[3] == plan[5]


def test_what_it_costs_is_what_its_specifications_cost(plan: EpisodePlan) -> None:
    config = parse_config(TEXT)
    assert estimate_run(config, plan) == estimate_run(config, tuple(plan))
    assert estimate_run(config, plan.without(plan.ids)).dataset_bytes == 0


def test_it_equals_what_holds_the_same_episodes(plan: EpisodePlan) -> None:
    assert plan == plan_episodes(parse_config(TEXT), FACTS)
    assert plan == list(plan)
    assert plan != plan[:8]
    assert plan != 9


def test_an_id_that_is_kept_is_not_part_of_a_specification(plan: EpisodePlan) -> None:
    spec = plan[0]
    other = replace(spec, index=5)
    assert other.episode_id != spec.episode_id
    assert pickle.loads(pickle.dumps(spec)) == spec
    assert "episode_id" not in spec.to_json()
