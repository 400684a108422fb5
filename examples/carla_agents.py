"""CARLA's own agents drive the ego: BasicAgent and BehaviorAgent.

They are not in the wheel: give the folder ``PythonAPI/carla`` of a CARLA release as one of
``ego.driver.folders``. They need networkx, numpy and shapely beside the client.
"""

import random

from carstage.collector.drivers import Driver


class Agent(Driver):
    """Drives by an agent, through the places of scenario ``route``, or wherever it likes."""

    def __init__(self, speed_kmh: float = 30.0, seed: int = 1) -> None:
        self.speed_kmh = speed_kmh
        self.seed = seed
        self.agent = None

    def make(self, observation):
        """The agent."""
        raise NotImplementedError

    def start(self, observation) -> None:
        """Make the agent, and give it its way."""
        random.seed(self.seed)  # without a way it draws one
        self.agent = self.make(observation)
        planner, way = self.agent.get_global_planner(), []
        here = observation.transform.location
        for goal in observation.goals:
            way += planner.trace_route(here, goal)
            here = goal
        if way:
            self.agent.set_global_plan(way)

    def drive(self, observation):
        """What the agent does."""
        return self.agent.run_step()


class Basic(Agent):
    """Keeps a speed, stops at red lights and for vehicles."""

    def make(self, observation):
        """A BasicAgent."""
        from agents.navigation.basic_agent import BasicAgent

        return BasicAgent(observation.ego, self.speed_kmh, {"dt": observation.step_s})


class Behavior(Agent):
    """Follows the speed limit and others, and overtakes.

    Args:
        behavior: ``cautious``, ``normal`` or ``aggressive``.
        seed: for what it draws.
    """

    def __init__(self, behavior: str = "normal", seed: int = 1) -> None:
        super().__init__(seed=seed)
        self.behavior = behavior

    def make(self, observation):
        """A BehaviorAgent."""
        from agents.navigation.behavior_agent import BehaviorAgent

        return BehaviorAgent(observation.ego, self.behavior, {"dt": observation.step_s})
