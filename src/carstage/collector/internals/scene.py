"""An episode's scene: everybody and everything that was spawned, ready to be stepped."""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Optional

from carstage.collector.drivers.base import Driver
from carstage.collector.drivers.driving import EgoDriving
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.internals.traffic_manager_wakeup import TickWatch, started_threads
from carstage.collector.scenario import Population, Scenario, make_scenario
from carstage.collector.scenario.events import EventRunner, check_map
from carstage.collector.sensors.rig import Rig
from carstage.collector.timing import CLOCKS, Clock, Tick
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec


class Scene:
    """What stands in the world, and how it gets from one step to the next.

    Args:
        session: the episode's world.
        clock: makes or awaits steps.
        scenario: moves who is moved by us.
        rig: the sensors.
        population: who was spawned.
        step_s: simulated time of a step.
        event_runner: what happens to the ego beside the scenario.
        driving: the ego's driver at work; None: the Traffic Manager drives, or nobody.
    """

    def __init__(
        self,
        session: WorldSession,
        clock: Clock,
        scenario: Scenario,
        rig: Rig,
        population: Population,
        step_s: float,
        event_runner: EventRunner,
        driving: Optional[EgoDriving],
    ) -> None:
        self._session = session
        self._clock = clock
        self._scenario = scenario
        self._step_s = step_s
        self._event_runner = event_runner
        self._driving = driving
        self.rig = rig
        self.ego: Any = population.ego
        self.requested: Dict[str, int] = population.requested
        self.spawned: Dict[str, int] = population.spawned

    def step(self, tick: Optional[int]) -> Tick:
        """Prepare the next step and make it; ``tick`` is None in the warm-up.

        Raises:
            RecordingError: the server's state is not the one of that step.
            DriverError: the ego's driver failed.
            RuntimeError: the server did not answer in time.
        """
        self._session.weather.advance((tick or 0) * self._step_s)
        self._scenario.before_step(tick)
        self._event_runner.before_step(tick)
        if self._driving is not None:
            self._driving.before_step(tick)
        self.rig.move_followers()
        return self._clock.step()

    def event_states(self) -> Optional[List[Dict[str, Any]]]:
        """How the planned events stood in the last step; None: none are planned."""
        return self._event_runner.states()

    def command(self) -> Optional[List[Any]]:
        """What the ego's driver commanded for the last step; None: it has none of its own."""
        return None if self._driving is None else self._driving.command


def build_scene(
    client: Any,
    session: WorldSession,
    spec: EpisodeSpec,
    server: ServerPlan,
    check: Callable[[], None],
    driver: Optional[Driver] = None,
    program: Optional[ProgramPlan] = None,
) -> Scene:
    """Spawn everybody and everything, in an order that depends on the plan alone.

    Args:
        client: ``carla.Client``.
        session: the episode's world.
        spec: the episode.
        server: for its timeout and the Traffic Manager's port.
        check: called between long stretches; raises when somebody asks to end.
        driver: of the ego; None: the Traffic Manager drives, or nobody.
        program: of scenario ``scenic`` or ``openscenario``.

    Raises:
        SceneError: the server cannot make the planned scene.
    """
    check()
    check_map(spec, session.map)
    scenario = make_scenario(client, session, spec, server, program)
    population = scenario.populate(check)
    check()
    with started_threads() as manager:
        scenario.prepare()
    watch = TickWatch(session.world, server.traffic_manager_port, manager)
    session.on_exit("tick watch", watch.stop)
    clock = CLOCKS[spec.timing.synchronous](session.world, server.timeout_s, watch)
    clock.step()  # so that the client knows what was spawned
    scenario.start(population)
    rig = Rig(session, spec, population.ego)
    driving = None
    if driver is not None:
        driving = EgoDriving(session, spec, driver, population.ego, rig, server.timeout_s)
    event_runner = EventRunner(session, spec, population, server.traffic_manager_port)
    return Scene(session, clock, scenario, rig, population, spec.step_s, event_runner, driving)
