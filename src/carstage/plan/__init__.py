"""From a configuration to episodes: every random choice drawn, every sensor listed, ids fixed.

``plan_episodes`` makes the specifications, ``estimate_run`` says what they will cost, and a
``Shard`` is a share of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.plan.drivers import Drive
    from carstage.plan.episodes import EpisodePlan
    from carstage.plan.estimate import RunEstimate, estimate_run, estimate_tick_s
    from carstage.plan.facts import ServerFacts
    from carstage.plan.planning import PlanMatcher, plan_episodes
    from carstage.plan.sampling import Sampling
    from carstage.plan.scenario import Recording, ScenarioProgram, Start, Storyboard, Track
    from carstage.plan.sharding import Shard
    from carstage.plan.sources import Source

__all__ = [
    "Drive",
    "EpisodePlan",
    "PlanMatcher",
    "Recording",
    "RunEstimate",
    "Sampling",
    "ScenarioProgram",
    "ServerFacts",
    "Shard",
    "Source",
    "Start",
    "Storyboard",
    "Track",
    "estimate_run",
    "estimate_tick_s",
    "plan_episodes",
]

__getattr__ = lazy_names(
    __name__,
    {
        "drivers": "Drive",
        "episodes": "EpisodePlan",
        "estimate": "RunEstimate estimate_run estimate_tick_s",
        "facts": "ServerFacts",
        "planning": "PlanMatcher plan_episodes",
        "sampling": "Sampling",
        "scenario": "Recording ScenarioProgram Start Storyboard Track",
        "sharding": "Shard",
        "sources": "Source",
    },
)
