"""The agents of an episode beside the ego."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from carstage.config import Config
from carstage.config.agents import DroneAgent, JunctionAgent, RoadsideAgent, VehicleAgent
from carstage.plan.draws import Draws
from carstage.plan.drivers import plan_comfort, plan_driver
from carstage.plan.drones import plan_drone
from carstage.plan.facts import ServerFacts
from carstage.plan.rig import pose_spec
from carstage.plan.starts import plan_start
from carstage.spec import AgentSeeds, AgentSpec, EgoSpec, JunctionSpec, SensorSpec

SensorsOf = Callable[[Config, int], tuple[SensorSpec, ...]]
"""The sensors of an agent by its position in the list."""

_STREAMS = 2000
_STREAMS_PER_AGENT = 4
"""An agent's draws come from streams of its own, so that one more moves no other."""
_LARGEST_SEED = 0x7FFF_FFFF  # CARLA keeps noise seeds in signed 32-bit integers


def plan_agents(
    config: Config,
    facts: ServerFacts,
    town: str,
    index: int,
    draws: Draws,
    sensors_of: SensorsOf,
    taken: Collection[int],
) -> tuple[AgentSpec, ...]:
    """The agents of an episode, in the order of the configuration.

    Args:
        config: what the user asks for.
        facts: what the server offers.
        town: the episode's map.
        index: of the episode.
        draws: random numbers of the configuration's seed.
        sensors_of: makes an agent's sensors.
        taken: spawn points that are the ego's or are named by the configuration.

    Raises:
        ConfigError: the map has no such spawn point.
    """
    made, taken = [], set(taken)
    for position, agent in enumerate(config.agents):
        stream = _STREAMS + _STREAMS_PER_AGENT * position
        vehicle = None
        if isinstance(agent, VehicleAgent):
            field = ("agents", position, "spawn")
            draw = draws.unit(index, stream + 2)
            start = plan_start(agent.spawn, facts, town, draw, *field, taken=taken)
            if start["spawn_index"] is not None:
                taken.add(start["spawn_index"])
            vehicle = EgoSpec(
                blueprint=agent.blueprint,
                color=None if agent.color == "random" else agent.color,
                driver=plan_driver(config, agent.driver),
                comfort=plan_comfort(agent.driver),
                **start,
            )
        seeds = (draws.word(index, stream + i) & _LARGEST_SEED for i in range(2))
        made.append(
            AgentSpec(
                name=agent.name,
                kind=agent.kind,
                sensors=sensors_of(config, position),
                seeds=AgentSeeds(*seeds),
                vehicle=vehicle,
                pose=pose_spec(agent.pose) if isinstance(agent, RoadsideAgent) else None,
                junction=_junction(agent, draws.unit(index, stream + 2))
                if isinstance(agent, JunctionAgent)
                else None,
                drone=plan_drone(agent) if isinstance(agent, DroneAgent) else None,
            )
        )
    return tuple(made)


def _junction(agent: JunctionAgent, draw: float) -> JunctionSpec:
    """Where a mast stands; ``draw``, in [0, 1), is for a random junction."""
    chosen = agent.junction
    return JunctionSpec(
        height_m=agent.height_m,
        arm=agent.arm,
        id=chosen if isinstance(chosen, int) else None,
        draw=draw if chosen == "random" else None,
        near_ego=chosen == "near_ego",
    )


def are_as_asked(agents: Sequence[AgentSpec], config: Config, sensors_of: SensorsOf) -> bool:
    """Whether recorded agents are those of a configuration; where they begin is not compared."""
    if len(agents) != len(config.agents):
        return False
    for position, (agent, asked) in enumerate(zip(agents, config.agents, strict=True)):
        driver = comfort = None
        if isinstance(asked, VehicleAgent):
            driver = plan_driver(config, asked.driver)
            comfort = plan_comfort(asked.driver)
        drone = plan_drone(asked) if isinstance(asked, DroneAgent) else None
        ego, sensors = agent.ego, sensors_of(config, position)
        recorded = (agent.name, agent.kind, ego.driver, ego.comfort, agent.sensors, agent.drone)
        if recorded != (asked.name, asked.kind, driver, comfort, sensors, drone):
            return False
    return True
