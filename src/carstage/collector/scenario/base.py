"""The seam of the scenarios: who is in an episode, and who moves them."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple, Type, TypeVar

from carstage.collector.actors import Walker, spawn_vehicles, spawn_walkers, start_walkers
from carstage.collector.agents import Agent, spawn_agents
from carstage.collector.comfort import ComfortableDriving
from carstage.collector.ego import ego_start, spawn_ego
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.lamps import Lamps
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec


class Population(NamedTuple):
    """Who was spawned; ``requested`` counts what was asked for, without ego and agents."""

    ego: Any
    vehicles: List[Any]
    walkers: List[Walker]
    requested: Dict[str, int]
    spawned: Dict[str, int]
    agents: Tuple[Agent, ...] = ()


class Scenario:
    """Spawns and drives the road users of one episode.

    The calls come in this order: ``populate``, ``prepare``, a first step of the world, ``start``,
    then ``before_step`` ahead of every further step.

    Attributes:
        may_place: whether others may put vehicles and walkers elsewhere before ``start``.

    Args:
        client: ``carla.Client``.
        session: the episode's world.
        spec: the episode.
        server: where it is, and where the client's Traffic Manager listens.
        program: of scenario ``scenic`` or ``openscenario``.
    """

    may_place = False

    def __init__(
        self,
        client: Any,
        session: WorldSession,
        spec: EpisodeSpec,
        server: ServerPlan,
        program: Optional[ProgramPlan] = None,
    ) -> None:
        del program
        self._client = client
        self._session = session
        self._spec = spec
        self._server = server
        self._lamps = Lamps(session, spec.weather.lights)

    def populate(self, check: Callable[[], None]) -> Population:
        """Spawn the planned ego, vehicles and walkers.

        Args:
            check: called between long stretches; raises when somebody asks to end.

        Raises:
            SceneError: the server lacks what is planned.
        """
        spec = self._spec
        start, _ = ego_start(self._session, spec)
        ego = spawn_ego(self._session, spec)
        agents = spawn_agents(self._session, spec, start)
        vehicles = spawn_vehicles(self._session, spec, start)
        check()
        walkers = spawn_walkers(self._session, spec, start)
        return Population(
            ego,
            vehicles,
            walkers,
            {"vehicles": spec.vehicles.total, "pedestrians": spec.pedestrians.group.count},
            {"vehicles": len(vehicles), "pedestrians": len(walkers)},
            agents,
        )

    def prepare(self) -> None:
        """Make what must be there when the episode takes its first step; nothing by default."""

    def start(self, population: Population) -> None:
        """Set everybody going, after the first step; by default lamps and walkers."""
        self._lamps.switch_street_lamps()
        start_walkers(self._session, population.walkers)

    def before_step(self, tick: Optional[int]) -> None:
        """Called ahead of each step: of a recorded tick, or None in the warm-up."""

    def driven_gently(self) -> Mapping[int, ComfortableDriving]:
        """Who drives with comfort, by actor id, once everybody goes; by default nobody."""
        return {}

    def event_states(self) -> Optional[List[Dict[str, Any]]]:
        """How each of its own events stands after :meth:`before_step`; None: it has none."""
        return None


SCENARIOS: Dict[str, Type[Scenario]] = {}
"""Kind to class, filled by :func:`scenario`."""
_MODULES = {
    "openscenario": "program",
    "replay": "replay",
    "scenic": "program",
    "storyboard": "storyboard",
}
"""By kinds that few episodes have, the module of this package that adds them when it is needed."""

ScenarioClass = TypeVar("ScenarioClass", bound=Type[Scenario])


def scenario(kind: str) -> Callable[[ScenarioClass], ScenarioClass]:
    """Class decorator that adds a kind of scenario."""

    def add(cls: ScenarioClass) -> ScenarioClass:
        SCENARIOS[kind] = cls
        return cls

    return add


def make_scenario(
    client: Any,
    session: WorldSession,
    spec: EpisodeSpec,
    server: ServerPlan,
    program: Optional[ProgramPlan] = None,
) -> Scenario:
    """The planned scenario.

    Raises:
        SceneError: unknown kind.
    """
    kind = spec.scenario.kind
    if kind in _MODULES:
        import_module("carstage.collector.scenario." + _MODULES[kind])
    if kind not in SCENARIOS:
        known = ", ".join(sorted({*SCENARIOS, *_MODULES}))
        raise SceneError("scenario.kind: %r is not known." % kind, "Known are: %s." % known)
    return SCENARIOS[kind](client, session, spec, server, program)
